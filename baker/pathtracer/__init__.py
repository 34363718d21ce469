"""The reference: irradiance, ambient occlusion and pictures by path tracing."""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__, "baker.trace", "baker.kernels")
