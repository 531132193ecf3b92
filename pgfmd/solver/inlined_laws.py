"""The functions of laws of adhesion, compiled into the loops of kernels: no flag, and no call, in a loop.

A kernel calls `attraction(gap, law)` with a law's numbers (physics/adhesion/base.py). These are of a type of the law's own:
by it the compiler finds the law's function, and puts its statements in the place of the call. So a kernel is compiled, and
kept in the cache, once for each law that it is used with, and in each precision; a run meets those of its law alone.
"""

from __future__ import annotations

import types
from collections.abc import Callable
from functools import cache
from sys import modules
from typing import Any

from numba.extending import register_jitable

from pgfmd.physics.adhesion import functions
from pgfmd.physics.adhesion.base import attraction, energy, function_of, stiffness

from .compiled import overloading

__all__ = ["attraction", "energy", "stiffness"]

LAWS = functions.__name__.rpartition(".")[0]
"""The package of the laws."""


# A number at a time; NumPy's own functions would not be vectorised.
@overloading(functions.clipped, inline="always")
def _clipped(value: Any, least: Any, most: Any) -> Callable[..., Any]:
    return lambda value, least, most: min(max(value, least), most)


@overloading(functions.chosen, inline="always")
def _chosen(condition: Any, one: Any, other: Any) -> Callable[..., Any]:
    return lambda condition, one, other: one if condition else other


@overloading(functions.piece_of)
def _piece_of(value: Any, knots: Any) -> Callable[..., Any]:
    def piece(value: Any, knots: Any) -> Any:
        low, high = 0, knots.size - 1
        while high - low > 1:
            middle = (low + high) // 2
            if knots[middle] <= value:
                low = middle
            else:
                high = middle
        return low

    return piece


@cache
def _inline(module: str) -> None:
    """Lets kernels call the functions that a module of laws defines, but for those above."""
    for found in vars(modules[module]).values():
        if isinstance(found, types.FunctionType) and found.__module__ == module and found not in _SCALAR:
            register_jitable(inline="always")(found)


_SCALAR = functions.clipped, functions.chosen, functions.piece_of
_inline(functions.__name__)


def _of_law(numbers: Any, name: str) -> Callable[[Any, Any], Any]:
    """The function of this name of a law, by the compiler's type of its numbers."""
    kind: type = numbers.instance_class
    for base in kind.__mro__:
        if base.__module__.startswith(LAWS):
            _inline(base.__module__)
    return function_of(kind, name)


@overloading(attraction, inline="always")
def _attraction(gap: Any, law: Any) -> Callable[[Any, Any], Any]:
    return _of_law(law, "attraction")


@overloading(energy, inline="always")
def _energy(gap: Any, law: Any) -> Callable[[Any, Any], Any]:
    return _of_law(law, "energy")


@overloading(stiffness, inline="always")
def _stiffness(gap: Any, law: Any) -> Callable[[Any, Any], Any]:
    return _of_law(law, "stiffness")
