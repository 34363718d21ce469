"""Importer plugins: each file reads one scene format."""
