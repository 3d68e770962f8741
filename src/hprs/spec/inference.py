"""Infers range, length and constancy of expressions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from hprs.errors import Position, SpecValidationError, did_you_mean
from hprs.spec import interval
from hprs.spec.expression import (
    Binary,
    Call,
    Expression,
    Name,
    Negate,
    Number,
)
from hprs.spec.interval import DomainError, Interval
from hprs.spec.vocabulary import BUILTIN_CONSTANTS, FUNCTIONS, REDUCTIONS


class Inferred(NamedTuple):
    """What is known of an expression: its range, its length (None: scalar), if it is constant."""

    range: Interval
    length: int | None = None
    constant: bool = False


def infer(expression: Expression, known: Mapping[str, Inferred]) -> Inferred:
    """Range, length and constancy of an expression over known names.

    Raises:
        SpecValidationError: A name is unknown, lengths differ or an operation is undefined
            somewhere in its arguments' ranges.
    """
    match expression:
        case Number(value):
            return Inferred(interval.point(value), constant=True)
        case Name(name):
            return _look_up(name, known, expression.position)
        case Negate(operand):
            part = infer(operand, known)
            return Inferred(interval.negate(part.range), part.length, part.constant)
        case Binary(operator, left, right):
            parts = (infer(left, known), infer(right, known))
            operation = _BINARY[operator]
            if operator == "*" and left == right:
                operation = _square
            return _apply(expression, parts, lambda: operation(parts[0].range, parts[1].range))
        case _:
            parts = tuple(infer(argument, known) for argument in expression.arguments)
            if expression.function in REDUCTIONS:
                return _reduce(expression, parts)
            if expression.function == "atan2" and all(part.constant for part in parts):
                # A constant's zero has a sign; that of a range has none.
                angle = math.atan2(parts[0].range.low, parts[1].range.low)
                return Inferred(interval.point(angle), constant=True)
            function = _FUNCTIONS[expression.function]
            return _apply(expression, parts, lambda: function(*(part.range for part in parts)))


def evaluate_constant(expression: Expression, known: Mapping[str, Inferred], what: str) -> float:
    """The value of a constant expression.

    Raises:
        SpecValidationError: It refers to a signal, or is too large for a float.
    """
    inferred = infer(expression, known)
    if not inferred.constant:
        raise SpecValidationError(
            f"{what} must be a constant expression, but it depends on a signal.",
            expression.position,
        )
    return inferred.range.low


class UnknownNameError(SpecValidationError):
    """A name is unknown; it may be one that is declared later."""

    name: str = ""


def _unknown(
    name: str, known: Mapping[str, Inferred], position: Position | None
) -> UnknownNameError:
    if name in FUNCTIONS:
        message = f"{name} is a function: write {name}(...)."
    else:
        message = f"unknown name '{name}'.{did_you_mean(name, (*known, *BUILTIN_CONSTANTS))}"
    error = UnknownNameError(message, position)
    error.name = name
    return error


def _look_up(name: str, known: Mapping[str, Inferred], position: Position | None) -> Inferred:
    if name == "inf":
        raise SpecValidationError("inf may stand only at the end of a range.", position)
    if name in BUILTIN_CONSTANTS:
        return Inferred(interval.point(BUILTIN_CONSTANTS[name]), constant=True)
    if name not in known:
        raise _unknown(name, known, position)
    return known[name]


def _apply(
    node: Binary | Call, parts: Sequence[Inferred], operation: Callable[[], Interval]
) -> Inferred:
    lengths = {part.length for part in parts} - {None}
    if len(lengths) > 1:
        listed = " and ".join(str(length) for length in sorted(lengths, key=str))
        raise SpecValidationError(f"vectors of lengths {listed} do not match.", node.position)
    constant = all(part.constant for part in parts)
    return Inferred(_defined(node, operation), next(iter(lengths), None), constant)


def _reduce(node: Call, parts: Sequence[Inferred]) -> Inferred:
    vectors = [part for part in parts if part.length is not None]
    if vectors and len(parts) > 1:
        raise SpecValidationError(
            f"{node.function}() reduces one vector or compares several scalars, not a mix of them.",
            node.position,
        )
    if vectors:
        length = vectors[0].length or 1
        reduced = _defined(node, lambda: _reduced(node.function, parts[0].range, length))
    else:
        ranges = [part.range for part in parts]
        reduced = _defined(node, lambda: _REDUCTIONS[node.function](ranges))
    return Inferred(reduced, None, all(part.constant for part in parts))


def _reduced(function: str, x: Interval, length: int) -> Interval:
    """Range of a reduction of a vector whose components lie in `x`."""
    if function == "sum":
        return interval.multiply(x, interval.point(float(length)))
    if function == "norm":
        _ = interval.multiply(interval.square(x), interval.point(float(length)))
        return interval.multiply(interval.absolute(x), interval.point(math.sqrt(length)))
    return x


def _defined(node: Binary | Call, operation: Callable[[], Interval]) -> Interval:
    try:
        return operation()
    except DomainError as error:
        raise SpecValidationError(
            f"{error}. Bound it with max(), clip() or `let`.", node.position
        ) from None


def _square(x: Interval, _: Interval) -> Interval:
    return interval.square(x)


def _hypot(x: Interval, y: Interval) -> Interval:
    return interval.hypotenuse((x, y))


_BINARY: Mapping[str, Callable[[Interval, Interval], Interval]] = {
    "+": interval.add,
    "-": interval.subtract,
    "*": interval.multiply,
    "/": interval.divide,
    "**": interval.power,
}
_FUNCTIONS: Mapping[str, Callable[..., Interval]] = {
    "abs": interval.absolute,
    "clip": interval.clip,
    "sqrt": interval.square_root,
    "exp": interval.exponential,
    "log": interval.logarithm,
    "sin": interval.sine,
    "cos": interval.cosine,
    "tan": interval.tangent,
    "atan2": interval.arctangent,
    "hypot": _hypot,
    "sign": interval.sign,
}
_REDUCTIONS: Mapping[str, Callable[[Sequence[Interval]], Interval]] = {
    "min": interval.minimum,
    "max": interval.maximum,
    "sum": interval.total,
    "mean": interval.mean,
    "norm": interval.norm,
}
