"""Builds meshes, and scenes for formats without nodes; reads the materials of OBJ files."""
