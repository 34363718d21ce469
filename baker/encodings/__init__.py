"""Plugins: one image format a file."""
