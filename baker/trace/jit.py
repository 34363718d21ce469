"""Decorators and primitives of kernels, chosen for short compile times.

The first bake after an install compiles all kernels that it uses. These decorators and primitives avoid the
following compile times, which were measured with Numba 0.68:

- A wrapper that makes a function callable from Python takes 40 ms to compile. Only `kernel` functions have a
  wrapper; `inner` functions have none.
- Kernels and inner functions are compiled without reference counts, because Python owns all their arrays.
- `np.zeros` compiles three functions in 0.2 s. `scratch` compiles none.
- `min` and `max` compile a function for each combination of types, in 40 ms each. `smaller` and `larger`
  compile to a comparison and a selection.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core.cgutils import alloca_once, memset
from numba.extending import intrinsic, register_jitable
from numba.np.arrayobj import populate_array
from numba.np.numpy_support import from_dtype
from numpy.typing import DTypeLike

_OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True, "_nrt": False}

# Decorator of a function that Python calls.
kernel: Any = njit(cache=True, **_OPTIONS)
# Decorator of a function that kernels call. It stays a Python function and is compiled into each kernel.
inner: Any = register_jitable(**_OPTIONS)
# Decorator of an inner function that LLVM always inlines, so that literal arguments become constants in its
# code.
pasted: Any = register_jitable(forceinline=True, **_OPTIONS)


def scratch(shape: tuple[int, ...], dtype: DTypeLike) -> Any:
    """Return a function, callable in kernels, that allocates an array of zeros on the stack.

    The kernel must not return the array. The shape is a compile-time constant of the kernel.

    Parameters
    ----------
    shape : tuple of int
        Shape of the array.
    dtype : data-type
        Type of the array's items.

    Returns
    -------
    intrinsic
        A function without arguments that returns the array.
    """
    element = from_dtype(np.dtype(dtype))
    array = types.Array(element, len(shape), "C")

    def make(typing_context):  # type: ignore[no-untyped-def]
        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            item = context.get_data_type(element)
            size = context.get_abi_sizeof(item)
            block = ir.ArrayType(item, math.prod(shape))
            memory = alloca_once(builder, block)  # type: ignore[no-untyped-call]
            length = context.get_constant(types.intp, size * math.prod(shape))
            memset(builder, memory, length, 0)  # type: ignore[no-untyped-call]
            made = context.make_array(array)(context, builder)
            steps = [size * math.prod(shape[axis + 1 :]) for axis in range(len(shape))]
            populate_array(  # type: ignore[no-untyped-call]
                made,
                data=builder.bitcast(memory, item.as_pointer()),
                shape=[context.get_constant(types.intp, n) for n in shape],
                strides=[context.get_constant(types.intp, step) for step in steps],
                itemsize=context.get_constant(types.intp, size),
                meminfo=None,
            )
            return made._getvalue()

        return array(), codegen

    return intrinsic(make)


def _choice(comparison: str) -> Any:
    """Return an intrinsic `choose(a, b)` that returns b if `b <comparison> a` is true, else a."""

    def choose(typing_context, a, b):  # type: ignore[no-untyped-def]
        common = typing_context.unify_types(a, b)

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            first, second = (
                context.cast(builder, value, kind, common)
                for value, kind in zip(arguments, signature.args, strict=True)
            )
            if isinstance(common, types.Float):
                chosen = builder.fcmp_ordered(comparison, second, first)
            elif common.signed:
                chosen = builder.icmp_signed(comparison, second, first)
            else:
                chosen = builder.icmp_unsigned(comparison, second, first)
            return builder.select(chosen, second, first)

        return common(a, b), codegen

    return intrinsic(choose)


# Functions for kernels that return the smaller and the larger of two numbers. If either is NaN, they return
# the first number.
smaller = _choice("<")
larger = _choice(">")
