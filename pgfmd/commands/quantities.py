"""Options that are quantities: a number and a unit, as in a scene."""

from __future__ import annotations

import math
from collections.abc import Callable

import typer


def quantity(
    text: str, dimension: str, option: str, allowed: Callable[[float], bool] = math.isfinite, words: str = "above zero"
) -> float:
    """The SI value of an option; a usage error in the words of `units`, or `words` where it is not allowed."""
    from pgfmd.units import UnitError, parse_quantity

    try:
        value = parse_quantity(text, dimension)
    except UnitError as error:
        raise typer.BadParameter(str(error), param_hint=option) from None
    if not allowed(value):
        raise typer.BadParameter(f"{text}: expected another {dimension}, {words}", param_hint=option)
    return value


def length(text: str | None, option: str) -> float | None:
    """A finite length [m] above zero; None if the option is not given."""
    return None if text is None else quantity(text, "length", option, lambda value: 0 < value < math.inf)


def gap(text: str | None, option: str) -> float | None:
    """A finite gap [m], zero or above; None if the option is not given."""
    words = "zero or above"
    return None if text is None else quantity(text, "length", option, lambda value: 0 <= value < math.inf, words)
