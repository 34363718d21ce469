"""Fixes and repairs of the meshes of a file: `baker check --fix` and `--repair`."""
