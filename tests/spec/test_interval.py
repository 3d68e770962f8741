from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hprs.spec import interval
from hprs.spec.interval import DomainError, Interval

INF = math.inf
BIG = 1.7976931348623157e308


def ends() -> st.SearchStrategy[float]:
    return st.one_of(
        st.integers(-4, 4).map(float),
        st.floats(-1e3, 1e3),
        st.floats(allow_nan=False, allow_infinity=False),
        st.sampled_from([math.pi / 2, -math.pi, 2 * math.pi, 1e-300, -0.0]),
    )


@st.composite
def samples(draw: st.DrawFn, *, infinite: bool = True) -> tuple[Interval, float]:
    """An interval and a number inside it."""
    low, value, high = sorted(draw(st.lists(ends(), min_size=3, max_size=3)))
    if infinite:
        low = draw(st.sampled_from([low] * 5 + [-INF]))
        high = draw(st.sampled_from([high] * 5 + [INF]))
    value = draw(st.sampled_from([value, value, max(low, -BIG), min(high, BIG)]))
    if value == 0.0:
        # A range that holds 0 holds both zeros, whatever the sign of its end.
        value = math.copysign(0.0, draw(st.sampled_from([-1.0, 1.0])))
    return Interval(low, high), value


def contains(range_: Interval, value: float) -> bool:
    """Whether the range holds the value up to rounding, where it overflows, its infinity."""
    if math.isnan(value):
        return True  # an intermediate overflow, not a value of the operation
    slack = 1e-9 * max(1.0, min(abs(value), BIG / 1e10))
    return range_.low - slack <= value <= range_.high + slack


def check(
    operation: Callable[..., Interval],
    function: Callable[..., float],
    *parts: tuple[Interval, float],
) -> None:
    """The operation's range holds the function's value, unless the operation is undefined."""
    try:
        range_ = operation(*(range_ for range_, _ in parts))
    except DomainError:
        return
    try:
        value = function(*(value for _, value in parts))
    except OverflowError:
        assert any(math.isinf(end) for given, _ in parts for end in (given.low, given.high))
        return
    assert contains(range_, value), (range_, value)


UNARY = {
    "negate": (interval.negate, lambda x: -x),
    "absolute": (interval.absolute, abs),
    "square": (interval.square, lambda x: x * x),
    "square_root": (interval.square_root, math.sqrt),
    "exponential": (interval.exponential, math.exp),
    "logarithm": (interval.logarithm, math.log),
    "sine": (interval.sine, math.sin),
    "cosine": (interval.cosine, math.cos),
    "tangent": (interval.tangent, math.tan),
    "sign": (interval.sign, lambda x: float((x > 0) - (x < 0))),
}
BINARY = {
    "add": (interval.add, lambda x, y: x + y),
    "subtract": (interval.subtract, lambda x, y: x - y),
    "multiply": (interval.multiply, lambda x, y: x * y),
    "divide": (interval.divide, lambda x, y: x / y),
    "power": (interval.power, lambda x, y: x**y),
    "arctangent": (interval.arctangent, math.atan2),
}
MANY = {
    "minimum": (interval.minimum, min),
    "maximum": (interval.maximum, max),
    "total": (interval.total, sum),
    "mean": (interval.mean, lambda values: sum(values) / len(values)),
    "norm": (interval.norm, lambda values: math.hypot(*values)),
    "hypotenuse": (interval.hypotenuse, lambda values: math.hypot(*values)),
}


@pytest.mark.parametrize("name", UNARY)
@given(x=samples())
@example(x=(Interval(1.0, 4.0), 2.0))
@example(x=(Interval(math.pi / 2 - 1e-9, math.pi / 2 + 1e-9), math.pi / 2))
@example(x=(Interval(5e6, 5e6 + 1), 5e6 + 0.5))
def test_functions_of_one_range_contain_their_values(name: str, x: tuple[Interval, float]) -> None:
    check(*UNARY[name], x)


@pytest.mark.parametrize("name", BINARY)
@given(x=samples(), y=samples())
@example(x=(Interval(0.0, 2.0), 1.0), y=(Interval(-3.0, -2.0), -2.0))
@example(x=(Interval(0.5, 2.0), 1.0), y=(Interval(-3.0, 2.0), -2.0))
@example(x=(Interval(1.0, INF), 3.0), y=(Interval(2.0, INF), 2.0))
@example(x=(Interval(-3.0, 2.0), -3.0), y=(Interval(3.0, 3.0), 3.0))
@example(x=(Interval(-3.0, -2.0), -3.0), y=(Interval(-3.0, -3.0), -3.0))
@example(x=(Interval(-3.0, 2.0), -3.0), y=(Interval(0.0, 0.0), 0.0))
@example(x=(Interval(0.0, 0.0), -0.0), y=(Interval(-1.0, -1.0), -1.0))
@example(x=(Interval(0.0, 0.0), 0.0), y=(Interval(0.0, 1.0), -0.0))
@example(x=(Interval(-0.0, 2.0), -0.0), y=(Interval(-2.0, -0.0), 0.0))
def test_operations_on_two_ranges_contain_their_values(
    name: str, x: tuple[Interval, float], y: tuple[Interval, float]
) -> None:
    check(*BINARY[name], x, y)


@pytest.mark.parametrize("name", MANY)
@given(parts=st.lists(samples(), min_size=1, max_size=4))
def test_reductions_of_ranges_contain_their_values(
    name: str, parts: list[tuple[Interval, float]]
) -> None:
    operation, function = MANY[name]
    check(
        lambda *ranges: operation(ranges),
        lambda *values: function(values),
        *parts,
    )


@given(x=samples(), low=samples(), high=samples())
def test_clipped_ranges_contain_their_values(
    x: tuple[Interval, float], low: tuple[Interval, float], high: tuple[Interval, float]
) -> None:
    check(interval.clip, lambda v, a, b: min(max(v, a), b), x, low, high)


@pytest.mark.parametrize(
    ("range_", "expected"),
    [
        (interval.absolute(Interval(-2, 1)), (0, 2)),
        (interval.absolute(Interval(-2, -1)), (1, 2)),
        (interval.square(Interval(-2, 1)), (0, 4)),
        (interval.multiply(Interval(-2, 1), Interval(-2, 1)), (-2, 4)),
        (interval.multiply(Interval(0, INF), Interval(0, INF)), (0, INF)),
        (interval.divide(Interval(1, 2), Interval(4, INF)), (0, 0.5)),
        (interval.divide(Interval(1, INF), Interval(1, INF)), (0, INF)),
        (interval.power(Interval(-2, 1), interval.point(2.0)), (0, 4)),
        (interval.power(Interval(-2, 1), interval.point(3.0)), (-8, 1)),
        (interval.power(Interval(1, 2), interval.point(-1.0)), (0.5, 1)),
        (interval.power(Interval(4, 9), interval.point(0.5)), (2, 3)),
        (interval.power(Interval(0.5, 2), Interval(-1, 1)), (0.5, 2)),
        (interval.power(Interval(-5, 5), interval.point(0.0)), (1, 1)),
        (interval.power(Interval(1, INF), interval.point(2.0)), (1, INF)),
        (interval.power(Interval(1, 1e300), interval.point(-2.0)), (0, 1)),
        (interval.power(Interval(-2, -1), interval.point(-3.0)), (-1, -0.125)),
        (interval.exponential(Interval(-INF, INF)), (0, INF)),
        (interval.logarithm(Interval(1, INF)), (0, INF)),
        (interval.sine(Interval(0, math.pi)), (0, 1)),
        (interval.sine(Interval(0, 2 * math.pi)), (-1, 1)),
        (interval.sine(Interval(0, INF)), (-1, 1)),
        (interval.cosine(Interval(-1, 1)), (math.cos(1), 1)),
        (interval.cosine(Interval(3, 4)), (-1, math.cos(4))),
        (interval.cosine(interval.point(0.0)), (1, 1)),
        (interval.tangent(Interval(-1, 1)), (math.tan(-1), math.tan(1))),
        (interval.tangent(Interval(1, 2)), (-INF, INF)),
        (interval.tangent(Interval(0, 4)), (-INF, INF)),
        (interval.tangent(interval.point(1.0)), (math.tan(1), math.tan(1))),
        (interval.arctangent(Interval(-1, 1), Interval(-1, 1)), (-math.pi, math.pi)),
        (interval.arctangent(Interval(1, 2), Interval(-1, 1)), (math.pi / 4, math.pi * 3 / 4)),
        (interval.arctangent(Interval(0, INF), Interval(1, INF)), (0, math.pi / 2)),
        (interval.arctangent(interval.point(1.0), interval.point(-1.0)), (math.pi * 3 / 4,) * 2),
        (interval.arctangent(interval.point(0.0), interval.point(1.0)), (0, 0)),
        (interval.arctangent(interval.point(0.0), interval.point(-1.0)), (-math.pi, math.pi)),
        (interval.sign(Interval(-2, 0)), (-1, 0)),
        (interval.mean([Interval(0, 1), Interval(2, 5)]), (1, 3)),
        (interval.norm([Interval(-3, 0), Interval(4, 4)]), (4, 5)),
        (interval.clip(Interval(-INF, INF), interval.point(-1.0), interval.point(1.0)), (-1, 1)),
        (Interval(0, 2).meet(Interval(1, 3)), (1, 2)),
    ],
)
def test_ranges_are_tight(range_: Interval, expected: tuple[float, float]) -> None:
    assert (range_.low, range_.high) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("operation", "message"),
    [
        (lambda: interval.divide(interval.point(1.0), Interval(-1, 1)), "divisor's range [-1, 1]"),
        (
            lambda: interval.power(Interval(-1, 1), interval.point(-1.0)),
            "contains 0 under a negative",
        ),
        (lambda: interval.power(Interval(-1, 1), interval.point(0.5)), "must be not negative"),
        (lambda: interval.power(Interval(0, 1), interval.point(-0.5)), "must be positive"),
        (lambda: interval.square_root(Interval(-1, 1)), "sqrt needs a range that is not negative"),
        (lambda: interval.logarithm(Interval(0, 1)), "log needs a positive range, got [0, 1]"),
        (lambda: interval.exponential(interval.point(1e9)), "too large for a float"),
        (lambda: interval.multiply(interval.point(-1e300), interval.point(1e300)), "too large"),
        (lambda: interval.exponential(Interval(-1e3, 1e3)), "too large for a float"),
        (lambda: interval.power(Interval(1, 1e300), interval.point(2.0)), "too large"),
        (lambda: interval.power(Interval(0, 10), Interval(0, 1e3)), "too large"),
        (lambda: interval.multiply(Interval(0, 1e300), Interval(0, 1e300)), "too large"),
        (lambda: interval.divide(Interval(0, 1e300), Interval(1e-300, 1)), "too large"),
        (lambda: interval.add(Interval(0, BIG), Interval(0, BIG)), "too large"),
        (lambda: interval.mean([Interval(0, BIG)] * 2), "too large"),
        (lambda: interval.norm([Interval(0, 1e200)] * 2), "too large"),
        (lambda: interval.hypotenuse([Interval(0, BIG)] * 2), "too large"),
        (lambda: Interval(INF, INF), "too large for a float"),
        (lambda: Interval(2, 1), "[2, 1] is empty"),
        (lambda: Interval(math.nan, 1), "[nan, 1] is empty"),
        (lambda: Interval(0, 1).meet(Interval(2, 3)), "[2, 1] is empty"),
    ],
)
def test_undefined_operations_are_named(operation: Callable[[], Interval], message: str) -> None:
    with pytest.raises(DomainError) as caught:
        operation()
    assert message in str(caught.value)


def test_an_interval_prints_as_in_a_task_and_knows_what_it_holds() -> None:
    assert str(Interval(-INF, 2.5)) == "[-inf, 2.5]"
    assert 2.5 in Interval(0, 2.5)
    assert 2.6 not in Interval(0, 2.5)
    assert Interval(1, 1).is_point
    assert not Interval(1, 2).is_point
