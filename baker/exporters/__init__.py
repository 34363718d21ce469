"""Exporter plugins: each file writes the files for one engine, from a finished output folder."""
