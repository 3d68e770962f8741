"""Array namespaces: finds the one that some values belong to, and its operations by name.

NumPy is recognised without help, so that it is the only dependency of a robot. Other arrays (JAX,
PyTorch) go through array-api-compat.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache, reduce
from types import ModuleType
from typing import Any, TypeAlias

import numpy as np

Array: TypeAlias = Any
"""An array of NumPy, JAX or PyTorch, or a Python float for a single value."""

Operations: TypeAlias = Mapping[str, Callable[..., Any]]
"""Functions of the task language by name; "reduce min" and its like act on the last axis."""


def namespace_of(values: Iterable[Array]) -> ModuleType:
    """The array namespace of some arrays and numbers; NumPy where there are only numbers.

    Raises:
        TypeError: The values belong to different namespaces, or to none.
    """
    arrays = [v for v in values if not isinstance(v, int | float | np.ndarray | np.generic | list)]
    if not arrays:
        return np
    from array_api_compat import array_namespace

    return array_namespace(*arrays)


def as_floating(value: Array, xp: ModuleType) -> Array:
    """The value as an array of floating-point numbers; floating-point arrays pass as they are."""
    if xp is np:
        array = np.asarray(value)
        return array if array.dtype.kind == "f" else array.astype(np.float64)
    if isinstance(value, bool | int | float | list | np.ndarray | np.generic):
        return xp.asarray(value) * 1.0
    return value if xp.isdtype(value.dtype, "real floating") else value * 1.0


def truth(condition: Array) -> bool | None:
    """Whether a condition holds; None under `jax.jit`, where it has no value yet."""
    try:
        return bool(condition)
    except TypeError:
        return None


def select(condition: Array, if_true: Array, if_false: Array) -> Array:
    """`where` for arrays, a plain choice for a plain condition."""
    if isinstance(condition, bool):
        return if_true if condition else if_false
    return namespace_of((condition, if_true, if_false)).where(condition, if_true, if_false)


@lru_cache
def array_operations(xp: ModuleType) -> Operations:
    """The language's operations on arrays of one namespace."""
    minimum = _extremum(xp, xp.minimum, _minimum)
    maximum = _extremum(xp, xp.maximum, _maximum)

    def clip(x: Array, low: Array, high: Array) -> Array:
        return minimum(maximum(x, low), high)

    def norm(x: Array) -> Array:
        return xp.sqrt(xp.sum(x * x, axis=-1))

    return {
        "/": _divide_arrays,
        "**": _power_arrays,
        "abs": xp.abs,
        "min": minimum,
        "max": maximum,
        "clip": clip,
        "sqrt": xp.sqrt,
        "exp": xp.exp,
        "log": xp.log,
        "sin": xp.sin,
        "cos": xp.cos,
        "tan": xp.tan,
        "atan2": _both(xp, xp.arctan2 if xp is np else xp.atan2),
        "hypot": _both(xp, xp.hypot),
        "sign": xp.sign,
        "reduce min": _on_last_axis(xp.min),
        "reduce max": _on_last_axis(xp.max),
        "reduce sum": _on_last_axis(xp.sum),
        "reduce mean": _on_last_axis(xp.mean),
        "reduce norm": norm,
    }


def both(a: Any, b: Any) -> Any:
    """Conjunction of truth values or arrays of them."""
    return a & b


def either(a: Any, b: Any) -> Any:
    """Disjunction of truth values or arrays of them."""
    return a | b


def float_operations() -> Operations:
    """The language's operations on Python floats, with NumPy's answers where Python would raise."""
    return _FLOAT_OPERATIONS


def _divide_arrays(a: Array, b: Array) -> Array:
    return a / b


def _power_arrays(a: Array, b: Array) -> Array:
    return a**b


def _on_last_axis(function: Callable[..., Array]) -> Callable[[Array], Array]:
    def apply(x: Array) -> Array:
        return function(x, axis=-1)

    return apply


def _both(xp: ModuleType, function: Callable[[Array, Array], Array]) -> Callable[..., Array]:
    """Lets one of two array arguments be a Python number, which PyTorch does not allow."""
    if xp is np:
        return function

    def apply(a: Array, b: Array) -> Array:
        if isinstance(a, float):
            a = xp.full_like(b, a)
        if isinstance(b, float):
            b = xp.full_like(a, b)
        return function(a, b)

    return apply


def _extremum(
    xp: ModuleType, function: Callable[[Array, Array], Array], plain: Callable[..., float]
) -> Callable[..., Array]:
    of_arrays = _both(xp, function)

    def pairwise(a: Array, b: Array) -> Array:
        # Two numbers, as in clip(0.1, 0, x), stay a number: an array would fix their precision.
        return (plain if isinstance(a, float) and isinstance(b, float) else of_arrays)(a, b)

    def extremum(first: Array, *others: Array) -> Array:
        return reduce(pairwise, others, first)

    return extremum


def _minimum(least: float, *others: float) -> float:
    for other in others:
        # NaN propagates, as in NumPy; Python's min() would drop it.
        least = least if least < other or least != least else other
    return least


def _maximum(most: float, *others: float) -> float:
    for other in others:
        most = most if most > other or most != most else other
    return most


def _divide(a: float, b: float) -> float:
    try:
        return a / b
    except ZeroDivisionError:
        return (
            math.nan if a == 0.0 or a != a else math.copysign(math.inf, a) * math.copysign(1.0, b)
        )


def _power(a: float, b: float) -> float:
    try:
        result = a**b
    except ZeroDivisionError:
        return math.copysign(math.inf, a) if b % 2.0 == 1.0 else math.inf
    except OverflowError:
        return -math.inf if a < 0.0 and b % 2.0 == 1.0 else math.inf
    return math.nan if isinstance(result, complex) else result


def _or_nan(function: Callable[[float], float]) -> Callable[[float], float]:
    def apply(x: float) -> float:
        try:
            return function(x)
        except ValueError:
            return math.nan

    return apply


def _exp(x: float) -> float:
    try:
        return math.exp(x)
    except OverflowError:
        return math.inf


def _log(x: float) -> float:
    return -math.inf if x == 0.0 else math.nan if x < 0.0 else math.log(x)


def _clip(x: float, low: float, high: float) -> float:
    return _minimum(_maximum(x, low), high)


def _reduced(function: Callable[..., Any]) -> Callable[[Array], float]:
    """A reduction of a vector of one state to a float."""

    def apply(x: Array) -> float:
        return float(function(x))

    return apply


def _sign(x: float) -> float:
    return x if x != x else float((x > 0.0) - (x < 0.0))


_FLOAT_OPERATIONS: Operations = {
    "/": _divide,
    "**": _power,
    "abs": abs,
    "min": _minimum,
    "max": _maximum,
    "clip": _clip,
    "sqrt": _or_nan(math.sqrt),
    "exp": _exp,
    "log": _log,
    "sin": _or_nan(math.sin),
    "cos": _or_nan(math.cos),
    "tan": _or_nan(math.tan),
    "atan2": math.atan2,
    "hypot": math.hypot,
    "sign": _sign,
    "reduce min": _reduced(np.min),
    "reduce max": _reduced(np.max),
    "reduce sum": _reduced(np.sum),
    "reduce mean": _reduced(np.mean),
    "reduce norm": _reduced(np.linalg.norm),
}
