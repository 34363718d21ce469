"""Topology of triangle meshes: equal vertices, shared edges, closed parts, solids."""
