"""Triangle meshes as such: equal vertices, shared edges, closed parts, solids."""
