"""Tables of a scene's materials for kernels, and the scene's ray tree."""
