"""Judges a finished bake against the path tracer."""
