"""Kernels that cut texels into the pieces that triangles take of them."""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__, "baker.trace", "baker.kernels")
