"""Compares two finished bakes on the surface, whatever their lightmap uv."""

from baker.difference.compare import Difference, DiffSettings, compare
from baker.difference.summary import difference_json

__all__ = ["DiffSettings", "Difference", "compare", "difference_json"]
