"""Embree's C API, ray packets, and compilation and caching of kernels. No other package calls Embree."""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__)
