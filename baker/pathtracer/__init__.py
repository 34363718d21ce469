"""Path-traced truth: shares rays with the bake and nothing else."""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__, "baker.trace", "baker.kernels", "baker.lights")
