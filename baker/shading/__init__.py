"""Material tables of a scene for kernels (base colour, emission, alpha, transmittance), and its ray tree."""
