"""Kernels that find overlapping coplanar faces and overlapping lightmap uv."""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__, "baker.trace")
