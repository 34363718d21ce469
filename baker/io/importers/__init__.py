"""Plugins: one scene format a file."""
