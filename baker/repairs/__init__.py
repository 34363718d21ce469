"""Fixes and repairs of the meshes of a scene file: `baker check --fix` and `--repair`.

A fix changes nothing visible. A repair changes the shape of a mesh.
"""
