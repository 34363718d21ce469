"""Memory at an address, as compiled callbacks of Embree see it."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic


def _pointer(typing_context, address):  # type: ignore[no-untyped-def]
    """Return an int64 address as a pointer that `numba.carray` takes."""
    signature = types.voidptr(types.int64)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], ir.IntType(8).as_pointer())

    return signature, codegen


pointer: Any = intrinsic(_pointer)
