"""Interval arithmetic: the range of an expression from the ranges of its signals.

Every operation returns an interval that contains all values its arguments' intervals allow, up to
rounding. An operation that is undefined somewhere in its arguments' intervals, or too large for a
float at finite ends of them, raises `DomainError`: from infinities come NaN.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

_TOO_LARGE = "the result is too large for a float"


class DomainError(ValueError):
    """An operation is not defined everywhere in its arguments' intervals."""


@dataclass(frozen=True)
class Interval:
    """All numbers from `low` to `high`; the ends may be infinite."""

    low: float
    high: float

    def __post_init__(self) -> None:
        """Reject empty intervals and NaN."""
        if math.isinf(self.low) and self.low == self.high:
            raise DomainError(_TOO_LARGE)
        if not self.low <= self.high:
            raise DomainError(f"[{self.low:g}, {self.high:g}] is empty")

    def __contains__(self, value: float) -> bool:
        """Whether the value lies in the interval, ends included."""
        return self.low <= value <= self.high

    def __str__(self) -> str:
        """The interval as it would be written in a task."""
        return f"[{self.low:g}, {self.high:g}]"

    @property
    def is_point(self) -> bool:
        """Whether the interval holds exactly one number."""
        return self.low == self.high

    def meet(self, other: Interval) -> Interval:
        """The common part of two intervals.

        Raises:
            DomainError: They have none.
        """
        return Interval(max(self.low, other.low), min(self.high, other.high))


def point(value: float) -> Interval:
    """The interval that holds one number."""
    return Interval(value, value)


def negate(x: Interval) -> Interval:
    """Range of `-x`."""
    return Interval(-x.high, -x.low)


def add(x: Interval, y: Interval) -> Interval:
    """Range of `x + y`."""
    return total((x, y))


def subtract(x: Interval, y: Interval) -> Interval:
    """Range of `x - y`."""
    return add(x, negate(y))


def multiply(x: Interval, y: Interval) -> Interval:
    """Range of `x * y`."""
    return _hull(_product(a, b) for a in (x.low, x.high) for b in (y.low, y.high))


def divide(x: Interval, y: Interval) -> Interval:
    """Range of `x / y`; `y` may not contain 0."""
    if 0.0 in y:
        raise DomainError(f"the divisor's range {y} contains 0")
    return _hull(_quotient(a, b) for a in (x.low, x.high) for b in (y.low, y.high))


def power(x: Interval, y: Interval) -> Interval:
    """Range of `x ** y`: integer exponents for any base, others for bases that are not negative."""
    if y.is_point and y.low.is_integer():
        return _integer_power(x, y.low)
    if x.low < 0.0 or (x.low == 0.0 and y.low < 0.0):
        raise DomainError(
            f"the base's range {x} must be {'positive' if y.low < 0.0 else 'not negative'} "
            "under this exponent"
        )
    return _hull(_power(a, b) for a in (x.low, x.high, 1.0) if a in x for b in (y.low, y.high))


def square(x: Interval) -> Interval:
    """Range of `x * x`."""
    return _integer_power(x, 2.0)


def absolute(x: Interval) -> Interval:
    """Range of `abs(x)`."""
    ends = (abs(x.low), abs(x.high))
    return Interval(0.0 if 0.0 in x else min(ends), max(ends))


def minimum(parts: Sequence[Interval]) -> Interval:
    """Range of the smallest of several values."""
    return Interval(min(p.low for p in parts), min(p.high for p in parts))


def maximum(parts: Sequence[Interval]) -> Interval:
    """Range of the largest of several values."""
    return Interval(max(p.low for p in parts), max(p.high for p in parts))


def total(parts: Sequence[Interval]) -> Interval:
    """Range of the sum of several values."""
    return Interval(_sum([p.low for p in parts]), _sum([p.high for p in parts]))


def mean(parts: Sequence[Interval]) -> Interval:
    """Range of the mean of several values."""
    return divide(total(parts), point(float(len(parts))))


def norm(parts: Sequence[Interval]) -> Interval:
    """Range of the Euclidean norm of several values, whose squares must be floats."""
    _ = total([square(part) for part in parts])
    return hypotenuse(parts)


def hypotenuse(parts: Sequence[Interval]) -> Interval:
    """Range of the Euclidean norm of several values, computed without their squares."""
    lows, highs = zip(*((end.low, end.high) for end in map(absolute, parts)), strict=True)
    return Interval(_finite(math.hypot(*lows), *lows), _finite(math.hypot(*highs), *highs))


def clip(x: Interval, low: Interval, high: Interval) -> Interval:
    """Range of `clip(x, low, high)`, that is `min(max(x, low), high)`."""
    return minimum((maximum((x, low)), high))


def square_root(x: Interval) -> Interval:
    """Range of `sqrt(x)`; `x` may not be negative."""
    if x.low < 0.0:
        raise DomainError(f"sqrt needs a range that is not negative, got {x}")
    return Interval(math.sqrt(x.low), math.sqrt(x.high))


def exponential(x: Interval) -> Interval:
    """Range of `exp(x)`."""
    return Interval(_exp(x.low), _exp(x.high))


def logarithm(x: Interval) -> Interval:
    """Range of `log(x)`; `x` must be positive."""
    if x.low <= 0.0:
        raise DomainError(f"log needs a positive range, got {x}")
    return Interval(math.log(x.low), math.log(x.high))


def sine(x: Interval) -> Interval:
    """Range of `sin(x)`."""
    return _periodic(x, math.sin, top=math.pi / 2)


def cosine(x: Interval) -> Interval:
    """Range of `cos(x)`."""
    return _periodic(x, math.cos, top=0.0)


def tangent(x: Interval) -> Interval:
    """Range of `tan(x)`; everything where a pole lies within."""
    everything = Interval(-math.inf, math.inf)
    if x.is_point:
        return point(math.tan(x.low))
    if x.high - x.low >= math.pi or _multiple_within(x, math.pi / 2, math.pi):
        return everything
    low, high = math.tan(x.low), math.tan(x.high)
    return Interval(low, high) if low <= high else everything


def arctangent(y: Interval, x: Interval) -> Interval:
    """Range of `atan2(y, x)`."""
    # A range that holds 0 holds both zeros, and atan2(-0.0, -1) is -pi.
    if 0.0 in y and x.low <= 0.0:
        return Interval(-math.pi, math.pi)
    # An infinite corner stands for every direction between its axes.
    angles: list[float] = []
    for b in (y.low, y.high):
        for a in (x.low, x.high):
            angles.append(math.atan2(b, a))
            if math.isinf(a) and math.isinf(b):
                angles += [math.atan2(b, 0.0), math.atan2(0.0, a) * math.copysign(1.0, b)]
    return _hull(angles)


def sign(x: Interval) -> Interval:
    """Range of `sign(x)`."""
    return Interval(_sign(x.low), _sign(x.high))


def _hull(values: Iterable[float]) -> Interval:
    found = list(values)
    return Interval(min(found), max(found))


def _product(a: float, b: float) -> float:
    # An infinite end stands for values without bound, never for infinity itself: 0 * x is 0.
    return 0.0 if 0.0 in (a, b) and math.inf in (abs(a), abs(b)) else _finite(a * b, a, b)


def _quotient(a: float, b: float) -> float:
    if math.isinf(b):
        return 0.0 if math.isfinite(a) else math.copysign(math.inf, a) * math.copysign(1.0, b)
    return _finite(a / b, a)


def _power(a: float, b: float) -> float:
    try:
        return a**b
    except OverflowError:
        raise DomainError(_TOO_LARGE) from None


def _sum(values: Sequence[float]) -> float:
    return _finite(sum(values), *values)


def _finite(result: float, *arguments: float) -> float:
    """The result of arguments; it may be infinite only where one of them is."""
    if math.isinf(result) and all(map(math.isfinite, arguments)):
        raise DomainError(_TOO_LARGE)
    return result


def _integer_power(x: Interval, exponent: float) -> Interval:
    if exponent < 0.0 and 0.0 in x:
        raise DomainError(f"the base's range {x} contains 0 under a negative exponent")
    if exponent == 0.0:
        return point(1.0)
    # Away from 0, an integer power of a magnitude is monotone.
    ends = absolute(x) if exponent % 2.0 == 0.0 else x
    return _hull(math.copysign(_power(abs(end), exponent), end) for end in (ends.low, ends.high))


def _exp(value: float) -> float:
    try:
        return math.exp(value)
    except OverflowError:
        raise DomainError(_TOO_LARGE) from None


def _sign(value: float) -> float:
    return float((value > 0) - (value < 0))


def _multiple_within(x: Interval, offset: float, period: float) -> bool:
    """Whether `offset + k * period` lies in `x` for an integer k, or may, as far as floats tell."""
    if max(abs(x.low), abs(x.high)) > 1e6:
        return True
    return math.floor((x.high - offset) / period) >= math.ceil((x.low - offset) / period)


def _periodic(x: Interval, function: Callable[[float], float], *, top: float) -> Interval:
    if math.isinf(x.low) or math.isinf(x.high) or x.high - x.low >= 2 * math.pi:
        return Interval(-1.0, 1.0)
    low, high = function(x.low), function(x.high)
    if x.is_point:
        return point(low)
    return Interval(
        -1.0 if _multiple_within(x, top + math.pi, 2 * math.pi) else min(low, high),
        1.0 if _multiple_within(x, top, 2 * math.pi) else max(low, high),
    )
