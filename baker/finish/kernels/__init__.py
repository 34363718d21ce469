"""Kernels over the pixels of a lightmap page."""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__, "baker.trace", "baker.core")
