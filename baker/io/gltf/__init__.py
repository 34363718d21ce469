"""glTF 2.0: documents, accessors, materials and meshes read; GLB files written."""
