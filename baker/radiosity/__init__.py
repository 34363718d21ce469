"""Patches, form factors, solve, final gather."""
