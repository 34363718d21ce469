"""Numba kernels that several packages share. They take arrays and numbers only."""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__, "baker.trace")
