"""Light families, one a file."""

from baker.trace.kernel_cache import allow_no_cache

allow_no_cache(__file__)
