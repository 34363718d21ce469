"""How kernels are compiled, and small things they are made of that compile fast.

The first bake after an install waits for the compiler, and how kernels are written decides how long. Measured
with Numba 0.68: a wrapper that makes a function callable from Python or C takes 40 ms, so an `inner` function
has none and a `kernel` one; both do without reference counts, since they get their arrays from Python and
keep none; `np.zeros` compiles three functions (0.2 s), `scratch` none; `min` and `max` compile a function for
each combination of types (40 ms) and call it, `smaller` and `larger` become one instruction.
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
# Decorator of a function that kernels call: it stays a Python function, and is compiled into each kernel.
inner: Any = register_jitable(**_OPTIONS)
# The same, copied to wherever it is called: numbers that it is called with become part of its code.
pasted: Any = register_jitable(forceinline=True, **_OPTIONS)


def scratch(shape: tuple[int, ...], dtype: DTypeLike) -> Any:
    """Return a function for kernels that makes a zeroed array in the memory of the kernel that calls it.

    The array must not be returned. Its size is part of the code, so loops over it need no checks.
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


# The smaller and the larger of two numbers, for kernels; the first one if either is no number.
smaller = _choice("<")
larger = _choice(">")
