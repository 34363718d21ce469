"""Findings about a scene before any light is computed."""
