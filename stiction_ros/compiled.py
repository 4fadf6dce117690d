"""Loops over samples, compiled to machine code at their first call.

The machine code is kept beside the sources, or in the user's cache directory, so only the
first run on a machine pays for it. It is made anew when the file of a function changes, but not
when the file of a function that it calls does: after that, delete ``__pycache__/*.nb?``.
Importing this module costs half a second: only what loops over whole records does so.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., object])


def compiled(function: Function) -> Function:
    """Return ``function`` compiled; arithmetic as in NumPy, a division by zero included."""
    try:
        return cast(Function, numba.njit(function, cache=True, error_model="numpy", nogil=True))
    except RuntimeError:  # no directory for the cache can be written: compiled in every process
        return cast(Function, numba.njit(function, error_model="numpy", nogil=True))


def compiled_fused(function: Function) -> Function:
    """Return ``function`` compiled as :func:`compiled` does, products and sums in one rounding."""
    fused = {"contract"}
    try:
        return cast(
            Function,
            numba.njit(function, cache=True, error_model="numpy", nogil=True, fastmath=fused),
        )
    except RuntimeError:  # as above
        return cast(Function, numba.njit(function, error_model="numpy", nogil=True, fastmath=fused))
