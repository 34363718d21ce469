"""Materials resolved for triangles, transmittance and alpha, and the ray tree."""
