"""Plugins: one kind of light without area a file."""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__, "baker.trace", "baker.kernels")
