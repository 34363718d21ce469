"""Scenes of plain meshes, for formats without nodes; materials of OBJ files."""
