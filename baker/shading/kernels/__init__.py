"""Filter functions that Embree calls at hits of surfaces with transparency."""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__, "baker.trace", "baker.kernels")
