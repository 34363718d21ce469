"""Filter functions that Embree calls for hits on triangles that let light through."""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__, "baker.trace", "baker.kernels")
