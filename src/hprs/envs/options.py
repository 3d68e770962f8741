"""Checks options of environments: on the command line they come as any JSON value."""

from __future__ import annotations

import math
import numbers
from contextlib import suppress
from typing import Any

from hprs.errors import UsageError


def number(name: str, given: Any) -> float:
    """A number.

    Raises:
        UsageError: It is none; a text of digits or a truth value is not taken for one.
    """
    if isinstance(given, numbers.Real) and not isinstance(given, bool):
        # Integers of more than 308 digits are numbers, and no floats.
        with suppress(OverflowError):
            return float(given)
    raise UsageError(f"{name} needs a number, got {given!r}.")


def switch(name: str, given: Any) -> bool:
    """A truth value.

    Raises:
        UsageError: It is none.
    """
    if isinstance(given, bool):
        return given
    raise UsageError(f"{name} needs true or false, got {given!r}.")


def count(name: str, given: Any, most: int = 10**6) -> int:
    """A whole number from 1 on.

    Raises:
        UsageError: It is none, or above `most`; a truth value is not taken for one.
    """
    whole = isinstance(given, numbers.Integral) and not isinstance(given, bool)
    if not whole or not 0 < int(given) <= most:
        raise UsageError(f"{name} needs a whole number from 1 to {most:,}, got {given!r}.")
    return int(given)


def edges(name: str, given: Any, limit: float) -> tuple[float, float]:
    """Two numbers within +-limit, the smaller one first.

    Raises:
        UsageError: They are not.
    """
    try:
        low, high = (number(name, edge) for edge in given)
    except (TypeError, ValueError):
        low = high = math.nan
    if not -limit <= low < high <= limit:
        raise UsageError(
            f"{name} needs two numbers in [-{limit}, {limit}], the smaller one first, "
            f"got {given!r}."
        )
    return low, high
