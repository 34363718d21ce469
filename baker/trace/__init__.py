"""Embree's C API, ray packets, and how kernels are compiled and kept; nothing else knows Embree."""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__)
