"""Compares two finished bakes at the same surface points, even if their lightmap uv differ."""
