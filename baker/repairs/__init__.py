"""Rewrites the meshes of a file where that keeps their look: `baker check --fix` and `--repair`."""
