"""Scenes made of plain meshes, for formats without nodes; OBJ materials."""
