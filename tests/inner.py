"""Doors into functions that only kernels call."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit


def compiled(*functions: Callable[..., Any]) -> tuple[Callable[..., Any], ...]:
    """Compile inner functions of kernels, so that a test can call them."""
    return tuple(njit(error_model="numpy")(getattr(f, "py_func", f)) for f in functions)
