"""Compilation of functions over small arrays by Numba.

At this size the overhead of a NumPy call exceeds its arithmetic: dozens of calls were most of a control step. Such a
function is compiled at the import of its module, for the types of its signature. So nothing is compiled while the robot
moves, and arguments of other types raise a TypeError. The machine code is cached beside the source, or in
NUMBA_CACHE_DIR.

A signature is the type of the result applied to those of the arguments: `NUMBER(VECTOR, MATRIX)`.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

_Function = TypeVar("_Function", bound=Callable[..., Any])

NOTHING: Any = numba.void
FLAG: Any = numba.boolean
COUNT: Any = numba.int64
NUMBER: Any = numba.float64
PAIR: Any = numba.types.UniTuple(numba.float64, 2)
#: With any strides, so that views of larger arrays fit too.
VECTOR: Any = numba.float64[:]
MATRIX: Any = numba.float64[:, :]
#: C-contiguous.
PACKED: Any = numba.float64[:, ::1]


def records(dtype: Any) -> Any:
    """The type of a vector of such records, by which a function gets many named constants at the cost of one."""
    return numba.from_dtype(dtype)[::1]


def compiled(signature: Any) -> Callable[[_Function], _Function]:
    """Decorator: compile for one signature. Divisions by zero give infinities or NaN, as in NumPy."""

    def compile_now(function: _Function) -> _Function:
        try:
            return cast(_Function, numba.njit(signature, cache=True, error_model="numpy")(function))
        except (RuntimeError, OSError):
            # Without a writable cache folder, as on a read-only file system, every start compiles.
            return cast(_Function, numba.njit(signature, error_model="numpy")(function))

    return compile_now
