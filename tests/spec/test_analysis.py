from __future__ import annotations

import math
import pickle
import warnings
from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hprs.errors import SpecValidationError
from hprs.spec.expression import Binary, Call, Comparison, Expression, Name, Negate, Number
from hprs.spec.parser import parse_task
from hprs.spec.task import Definition, Remark, Requirement, Signal, Task
from hprs.spec.traversal import comparisons as leaves_of
from tests.strategies import signals_for, tasks

SIGNALS = "signal x in [-5, 5]\nsignal y in [0, 1]\nsignal v[3] in [0, 2]\n"
QUIET = "conquer goal: max(v) + x + y <= 6\n"
INF = math.inf


def range_of(expression: str) -> tuple[float, float]:
    found = parse_task(f"{SIGNALS}let e = {expression}").ranges["e"]
    return found.low, found.high


def remarks(requirements: str) -> list[str]:
    return [remark.message for remark in parse_task(SIGNALS + QUIET + requirements).remarks]


# --- a second, independent evaluation

BINARY = {"+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "**": np.power}
SCALAR = {
    "abs": np.abs,
    "clip": lambda x, low, high: np.minimum(np.maximum(x, low), high),
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "atan2": np.arctan2,
    "hypot": np.hypot,
    "sign": np.sign,
}
REDUCED = {
    "min": np.min,
    "max": np.max,
    "sum": np.sum,
    "mean": np.mean,
    "norm": lambda x, axis: np.sqrt(np.sum(x * x, axis=axis)),
}


def value_of(expression: Expression, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """The value in one state: a scalar array, or a vector."""
    match expression:
        case Number(number):
            return np.asarray(number)
        case Name("pi"):
            return np.asarray(math.pi)
        case Name("deg"):
            return np.asarray(math.pi / 180.0)
        case Name(name):
            return values[name]
        case Negate(operand):
            return -value_of(operand, values)
        case Binary(operator, left, right):
            return BINARY[operator](value_of(left, values), value_of(right, values))
        case Call(function, arguments) if function in REDUCED:
            parts = [value_of(argument, values) for argument in arguments]
            whole = parts[0] if len(parts) == 1 and parts[0].ndim else np.stack(parts)
            return REDUCED[function](whole, axis=-1)
        case Call(function, arguments):
            return SCALAR[function](*(value_of(argument, values) for argument in arguments))


def well_conditioned(expression: Expression, values: Mapping[str, np.ndarray]) -> bool:
    """Whether no intermediate value is so large that cancellation hides the result."""
    parts: tuple[Expression, ...] = ()
    match expression:
        case Negate(operand):
            parts = (operand,)
        case Binary(_, left, right):
            parts = (left, right)
        case Call(function, arguments):
            if function == "tan":
                return False
            parts = arguments
        case _:
            pass
    value = value_of(expression, values)
    return bool(np.all(np.abs(value) < 1e6)) and all(well_conditioned(p, values) for p in parts)


@given(tasks(), st.data())
def test_bounds_contain_every_margin_of_signals_in_their_ranges(
    task: Task, data: st.DataObject
) -> None:
    values = dict(data.draw(signals_for(task)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for declared in (*task.constants, *task.definitions):
            values[declared.name] = value_of(declared.value, values)
            assert_within(values[declared.name], task.ranges[declared.name], declared.value, values)
        for requirement in task.requirements:
            ranges = task.analysis.leaves[requirement.label]
            for leaf, range_ in zip(leaves_of(requirement.predicate), ranges, strict=True):
                assert_within(value_of(leaf.margin, values), range_, leaf.margin, values)


def assert_within(
    value: np.ndarray, range_: object, expression: Expression, values: Mapping[str, np.ndarray]
) -> None:
    if well_conditioned(expression, values):
        low, high = range_.low, range_.high  # type: ignore[attr-defined]
        assert np.all(value >= low - 1e-6)
        assert np.all(value <= high + 1e-6)


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("2 * x + 1", (-9, 11)),
        ("x * x", (0, 25)),
        ("x ** 2", (0, 25)),
        ("(x + y) * (x + y)", (0, 36)),
        ("x * y", (-5, 5)),
        ("-x ** 2", (-25, 0)),
        ("abs(x) - y", (-1, 5)),
        ("max(v)", (0, 2)),
        ("min(v)", (0, 2)),
        ("mean(v)", (0, 2)),
        ("sum(v)", (0, 6)),
        ("norm(v)", (0, 2 * math.sqrt(3))),
        ("sum(x, y)", (-5, 6)),
        ("min(x, y, 0.5)", (-5, 0.5)),
        ("max(x)", (-5, 5)),
        ("hypot(x, y)", (0, math.sqrt(26))),
        ("clip(x, -1, 1)", (-1, 1)),
        ("sum(v * 2 - y)", (-3, 12)),
        ("sqrt(y) + exp(y) + log(y + 1)", (1, 1 + math.e + math.log(2))),
        ("sin(y) + cos(y)", (math.cos(1), 1 + math.sin(1))),
        ("tan(y) + atan2(y, 1) + sign(y)", (0, math.tan(1) + math.pi / 4 + 1)),
        ("180 deg", (math.pi, math.pi)),
        ("x in [-1, 100]", (-1, 5)),
        ("x in [-inf, 0]", (-5, 0)),
        ("exp(700 * y)", (1, math.exp(700))),
    ],
)
def test_ranges_of_expressions(expression: str, expected: tuple[float, float]) -> None:
    assert range_of(expression) == pytest.approx(expected)


def test_lengths_and_constancy_are_known_of_every_name() -> None:
    task = parse_task(f"{SIGNALS}const c = 2 * pi\nlet w = v * x + c\nlet k = 2 * c")
    known = task.analysis.known
    assert [known[name].length for name in ("x", "v", "w", "c")] == [None, 3, 3, None]
    assert [known[name].constant for name in ("x", "w", "c", "k")] == [False, False, True, True]


def test_bounds_of_and_or_are_the_minimum_and_maximum_of_their_parts() -> None:
    task = parse_task(
        f"{SIGNALS}ensure a: x <= 1 and (y <= 0.5 or x >= 0)\nensure b: x <= 1 or y > 0"
    )
    assert task.bounds == {"a": (-4, 5.0), "b": (0, 6)}
    lows = {
        label: tuple(leaf.low for leaf in found) for label, found in task.analysis.leaves.items()
    }
    assert lows == {"a": (-4, -0.5, -5), "b": (-4, 0)}


# --- remarks


def test_a_sound_task_gets_no_remarks() -> None:
    assert remarks("ensure low: x <= 4\nencourage near: abs(x) < 1") == []


@pytest.mark.parametrize(
    "condition", ["abs(x) <= 7", "x >= -5", "x <= 7 and y >= 0", "x <= 7 or x > 2"]
)
def test_what_always_holds_is_worth_a_remark(condition: str) -> None:
    assert "'r' is always satisfied" in remarks(f"ensure r: {condition}")[0]


def test_a_threshold_outside_the_range_is_named_on_either_side() -> None:
    for condition in ("abs(x) <= 7", "7 >= abs(x)"):
        assert "The threshold 7 is outside the range [0, 5]" in remarks(f"ensure r: {condition}")[0]
    assert "The threshold" not in remarks("ensure r: y + 5 >= x")[0]
    assert "The threshold" not in remarks("ensure r: x >= -5")[0]


def test_a_strict_comparison_at_its_bound_does_not_always_hold() -> None:
    assert remarks("ensure r: x > -5") == []
    assert "always" in remarks("ensure r: x >= -5")[0]


def test_one_comparison_that_never_or_always_holds_is_worth_a_remark() -> None:
    assert remarks("ensure r: x <= 4 or x >= 6") == [
        "a comparison in requirement 'r' is never satisfied: its margin lies in [-11, -1]."
    ]
    assert remarks("ensure r: x <= 4 and x <= 6") == [
        "a comparison in requirement 'r' is always satisfied: its margin lies in [1, 11]."
    ]


def test_a_margin_that_never_exceeds_0_is_worth_a_remark() -> None:
    assert "never exceeds 0" in remarks("ensure r: x >= 5")[0]


def test_an_unused_signal_and_a_missing_target_are_worth_remarks() -> None:
    task = parse_task("signal x in [0, 1]\nsignal y in [0, 1]\nlet d = y\nensure a: 1 <= 2")
    messages = [remark.message for remark in task.remarks]
    assert "signal 'x' is never used." in messages
    assert not any("'y'" in message for message in messages)
    assert any("the task has no target" in message for message in messages)


def test_remarks_know_their_place() -> None:
    task = parse_task("signal x in [0, 1]\nconquer a: 1 <= 2")
    assert [remark.position is not None for remark in task.remarks] == [True, True]
    assert Remark("m") == Remark("m", position=task.remarks[0].position)


# --- errors


@pytest.mark.parametrize(
    "condition", ["x > 5", "x >= 6", "x > 5 and y <= 0.5", "x > 5 or y > 1", "2 < 1"]
)
def test_what_never_holds_is_an_error(condition: str) -> None:
    with pytest.raises(SpecValidationError, match="'r' can never be satisfied"):
        parse_task(f"{SIGNALS}ensure r: {condition}")


@pytest.mark.parametrize("kind", ["achieve", "conquer", "encourage"])
def test_a_continuous_score_needs_a_finite_lower_bound(kind: str) -> None:
    task = "signal w in [0, inf]\n{} r: {}"
    with pytest.raises(SpecValidationError, match="needs a finite lower bound"):
        parse_task(task.format(kind, "w <= 1"))
    with pytest.raises(SpecValidationError, match="needs a finite lower bound"):
        parse_task(task.format(kind, "w >= 1 and w <= 2"))
    for condition in ("w >= 1", "clip(w, 0, 9) <= 1"):
        assert parse_task(task.format(kind, condition)).bounds["r"][0] > -INF
    assert parse_task(task.format("ensure", "w <= 1")).bounds["r"] == (-INF, 1)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("signal x in [-inf, -inf]", "needs low < high"),
        ("signal x in [0, 1 / 0]", "divisor's range"),
        ("signal x in [0, exp(1000)]", "too large for a float"),
        ("signal x in [-1e3, 1e3]\nlet d = cos(exp(x))", "too large for a float"),
        ("signal x in [-1e3, 1e3]\nlet d = (0 - x) * 2 ** (2 * x)", "too large for a float"),
        ("signal x[4] in [0, 1e154]\nlet d = norm(x)", "too large for a float"),
        ("signal x in [inf - 1, 2]", "inf may stand only at the end"),
        ("const a = -inf", "inf may stand only at the end"),
        ("signal x in [0, 1]\nlet d = x in [1, 0]", "needs low < high"),
        ("signal x in [0, b]\nconst a = 1", "unknown name 'b'"),
        ("signal x in [0, d]\nlet d = 1", "'d' is used before its declaration"),
        ("const a = b\nconst b = 1", "'b' is used before its declaration"),
        ("signal x in [0, 1] \nensure pi: x <= 0.5", "'pi' is a reserved word"),
        ("signal v[2] in [0, 1]\nsignal x in [0, max(v)]", "depends on a signal"),
    ],
)
def test_declarations_that_cannot_be_meant_are_refused(text: str, message: str) -> None:
    with pytest.raises(SpecValidationError, match=message):
        parse_task(text)


@pytest.mark.parametrize("name", ["", "two words", "1st", "größe", "a-b"])
def test_names_built_in_python_are_checked(name: str) -> None:
    with pytest.raises(SpecValidationError, match="is not a name: use letters"):
        Task((Signal(name, 0, 1),))


def test_a_constant_that_no_float_can_hold_is_refused() -> None:
    infinite = Definition("d", Name("x"), -Name("inf"), Name("inf"))
    assert Task((Signal("x", 0, 1),), definitions=(infinite,)).ranges["d"].high == 1
    with pytest.raises(SpecValidationError, match="too large for a float"):
        parse_task("const a = tan(1) * 1e308 * 10")


def test_an_unknown_name_can_be_pickled_with_its_message() -> None:
    with pytest.raises(SpecValidationError) as caught:
        Task(requirements=(Requirement("ensure", "a", Comparison(Name("q"), "<=", Number(1.0))),))
    assert str(pickle.loads(pickle.dumps(caught.value))) == "unknown name 'q'."


def test_the_sign_of_a_zero_counts_in_atan2() -> None:
    task = parse_task(
        "signal v in [-1, 1]\nconst up = atan2(0, -1)\nconst down = atan2(0 * -1, -1)\n"
        "let angle = atan2(0 * v, -1)\nensure turned: angle >= 0"
    )
    assert (task.ranges["up"].low, task.ranges["down"].low) == (math.pi, -math.pi)
    assert (task.ranges["angle"].low, task.ranges["angle"].high) == (-math.pi, math.pi)
    assert task.margins({"v": 1.0}) == {"turned": math.pi}
    assert task.margins({"v": -1.0}) == {"turned": -math.pi}
