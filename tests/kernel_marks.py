"""Finds the kernels in the syntax tree of a file, for tests of the source."""

from __future__ import annotations

import ast

KERNEL_MARKS = {"kernel", "inner", "njit", "jit", "cfunc", "vectorize", "guvectorize"}


def is_kernel(node):
    """Return whether a decorator of a function is, or calls, one of `KERNEL_MARKS`."""
    marks = {name.id for mark in node.decorator_list for name in ast.walk(mark) if isinstance(name, ast.Name)}
    return bool(marks & KERNEL_MARKS)
