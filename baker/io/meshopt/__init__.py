"""Decodes buffer views that are compressed with meshoptimizer."""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__, "baker.trace")
