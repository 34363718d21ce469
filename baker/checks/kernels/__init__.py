"""Kernels of the checks: coplanar faces, overlapping uv."""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__, "baker.trace")
