"""The only part that knows Embree."""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__)
