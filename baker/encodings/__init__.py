"""Encoding plugins: each file writes and reads one image format."""
