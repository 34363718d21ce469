"""Path-traced truth: shares rays with the bake and nothing else."""
