"""Reads glTF 2.0 documents, accessors, materials and meshes; writes GLB files."""
