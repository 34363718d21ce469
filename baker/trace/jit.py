"""Decorators and primitives of kernels, chosen for short compile times.

The first bake after an install has to compile them. Measured with Numba 0.68:

- A wrapper that makes a function callable from Python or C takes 40 ms. A `kernel` has one, an `inner`
  function none.
- Both are compiled without reference counts: their arrays are owned by Python, and they store none.
- `np.zeros` compiles three functions (0.2 s), `scratch` none.
- `min` and `max` compile a function for each combination of types (40 ms) and call it; `smaller` and `larger`
  are one instruction.
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
# Decorator of a function that kernels call: it remains a Python function, and is compiled into each kernel.
inner: Any = register_jitable(**_OPTIONS)
# The same, always inlined by LLVM: literal arguments become constants of its code.
pasted: Any = register_jitable(forceinline=True, **_OPTIONS)


def scratch(shape: tuple[int, ...], dtype: DTypeLike) -> Any:
    """Return a function for kernels that makes a zeroed array on the stack of the calling kernel.

    The array must not be returned. Its shape is part of the code, so loops over it need no checks.

    Parameters
    ----------
    shape : tuple of int
        Shape of the array.
    dtype : data-type
        Type of its items.

    Returns
    -------
    intrinsic
        Takes no arguments, and returns the array.
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
    """Return an intrinsic `choose(a, b)`: b if `b comparison a`, else a."""

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


# The smaller and the larger of two numbers, for kernels; the first one if either is NaN.
smaller = _choice("<")
larger = _choice(">")
