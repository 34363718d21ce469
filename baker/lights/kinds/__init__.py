"""Kinds of lights without area; each file registers one kind."""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__, "baker.trace", "baker.kernels")
