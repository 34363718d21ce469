"""Embree's C API, ray packets, and how kernels are compiled and cached; no other package calls Embree."""

from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__)
