"""Compiles `inner` functions for tests, because otherwise only kernels can call them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit


def compiled(*functions: Callable[..., Any]) -> tuple[Callable[..., Any], ...]:
    """Return compiled versions of `inner` functions that Python can call."""
    return tuple(njit(error_model="numpy")(getattr(f, "py_func", f)) for f in functions)
