"""Kernels for uv charts: overlap and packing."""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__, "baker.trace")
