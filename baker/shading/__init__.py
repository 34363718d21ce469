"""Materials resolved for triangles, what lets light through, and the ray tree."""
