"""Lights: emissive triangles as a table of emitters, and lights without area (`kinds`)."""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__, "baker.trace", "baker.kernels")
