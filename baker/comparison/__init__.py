"""Compares two finished bakes at the same points of the surface, whatever their lightmap uv."""

from baker.comparison.compare import Difference, DiffSettings, compare
from baker.comparison.summary import difference_json

__all__ = ["DiffSettings", "Difference", "compare", "difference_json"]
