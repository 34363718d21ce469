"""Compares two finished bakes at the same points of the surface, whatever their lightmap uv."""
