"""Compares a finished bake with path-traced reference values."""
