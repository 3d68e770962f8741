"""Compiled margins, against values worked by hand, on every kind of number."""

from __future__ import annotations

import ast
import math
from pathlib import Path
from typing import Any

import array_api_compat.torch as torch_xp
import jax.numpy as jnp
import numpy as np
import pytest
import torch

import hprs
from hprs import parse_task
from hprs.spec.compiler import compile_margins, used_signals
from hprs.spec.namespace import namespace_of
from hprs.spec.task import Task
from hprs.spec.traversal import comparisons

HEADER = """
signal x in [-2, 2]
signal y in [0.5, 4]
signal p[3] in [-2, 2]
signal q[3] in [1, 5]
const k = 3
let sum_of_two = x + y
let twice = 2 * x
let shifted = p - x
"""
STATE = {"x": -0.5, "y": 2.0, "p": np.asarray([1.0, -1.0, 0.5]), "q": np.asarray([1.0, 2.0, 4.0])}

EXPRESSIONS = {
    # x = -0.5, y = 2, p = (1, -1, 0.5), q = (1, 2, 4)
    "x": -0.5,
    "-x": 0.5,
    "x + y": 1.5,
    "x - y": -2.5,
    "x * y": -1.0,
    "x / y": -0.25,
    "1 + x": 0.5,
    "1 - x": 1.5,
    "3 * x": -1.5,
    "3 / y": 1.5,
    "x + 1": 0.5,
    "x - 1": -1.5,
    "x * 3": -1.5,
    "x / 4": -0.125,
    "x - k": -3.5,
    "k - abs(x)": 2.5,
    "x ** 2": 0.25,
    "x ** 3": -0.125,
    "x ** 0": 1.0,
    "y ** -1": 0.5,
    "y ** 0.5": math.sqrt(2.0),
    "y ** x": 2.0**-0.5,
    "2 ** x": 2.0**-0.5,
    "y ** 64": 2.0**64,
    "x * x": 0.25,
    "abs(x)": 0.5,
    "abs(x - y)": 2.5,
    "min(x, y)": -0.5,
    "max(x, y)": 2.0,
    "min(x)": -0.5,
    "max(1, x)": 1.0,
    "max(x, 0)": 0.0,
    "max(x, -1)": -0.5,
    "min(x, -1)": -1.0,
    "min(1, 2, x)": -0.5,
    "max(x, 0, y, 1)": 2.0,
    "sum(x, y, 1)": 2.5,
    "sum(x, y)": 1.5,
    "sum(y)": 2.0,
    "mean(x, y)": 0.75,
    "mean(x, 1, 1)": 0.5,
    "norm(x, y)": math.hypot(0.5, 2.0),
    "norm(x, 2)": math.hypot(0.5, 2.0),
    "norm(x)": 0.5,
    "clip(x, 0, 1)": 0.0,
    "clip(x, -1, y)": -0.5,
    "clip(0, x, y)": 0.0,
    "clip(0.1, 0, y)": 0.1,
    "sqrt(y)": math.sqrt(2.0),
    "exp(x)": math.exp(-0.5),
    "log(y)": math.log(2.0),
    "sin(x)": math.sin(-0.5),
    "cos(x)": math.cos(-0.5),
    "tan(x)": math.tan(-0.5),
    "atan2(x, y)": math.atan2(-0.5, 2.0),
    "atan2(x, 1)": math.atan2(-0.5, 1.0),
    "atan2(1, y)": math.atan2(1.0, 2.0),
    "hypot(x, y)": math.hypot(0.5, 2.0),
    "hypot(3, x)": math.hypot(3.0, 0.5),
    "sign(x)": -1.0,
    "x + pi": math.pi - 0.5,
    "x + 90 deg": math.pi / 2 - 0.5,
    "x + sqrt(k)": math.sqrt(3.0) - 0.5,
    "min(p)": -1.0,
    "max(p)": 1.0,
    "sum(p)": 0.5,
    "mean(p)": 0.5 / 3.0,
    "norm(p)": 1.5,
    "sum(-p)": -0.5,
    "sum(p + q)": 7.5,
    "sum(p - x)": 2.0,
    "sum(x - p)": -2.0,
    "sum(p - 1)": -2.5,
    "sum(1 - p)": 2.5,
    "sum(2 * p)": 1.0,
    "sum(p * q)": 1.0,
    "sum(p / q)": 0.625,
    "sum(1 / q)": 1.75,
    "sum(p ** 2)": 2.25,
    "sum(2 ** p)": 2.0 + 0.5 + math.sqrt(2.0),
    "sum(q ** x)": 1.0 + 2.0**-0.5 + 0.5,
    "sum(abs(p))": 2.5,
    "sum(1 - abs(p))": 0.5,
    "sum(sqrt(q))": 3.0 + math.sqrt(2.0),
    "sum(sign(p))": 1.0,
    "sum(clip(p, x, 1))": 1.0,
    "sum(hypot(p, x))": math.hypot(1, 0.5) * 2 + math.hypot(0.5, 0.5),
    "sum(hypot(3, q))": math.hypot(3, 1) + math.hypot(3, 2) + 5.0,
    "sum(atan2(p, y))": math.atan2(0.5, 2.0),
    "sum(atan2(p, 2))": math.atan2(0.5, 2.0),
    "max(min(p), x)": -0.5,
    "sum_of_two": 1.5,
    "sum_of_two * sum_of_two": 2.25,
    "1 - sum_of_two": -0.5,
    "twice - 1": -2.0,
    "1 - abs(twice)": 0.0,
    "max(shifted)": 1.5,
    "max(shifted) + min(shifted)": 1.0,
    "sum_of_two + twice": 0.5,
}


def margin_task(expression: str) -> Task:
    # The second part keeps the requirement from being refused as never satisfied.
    return parse_task(f"{HEADER}ensure r: {expression} >= 0 or x <= 5")


def first_margin(task: Task, signals: dict[str, Any], xp: Any) -> Any:
    leaf = comparisons(task.requirements[0].predicate)[0]
    return compile_margins(task, [leaf], xp)(signals)[0]


@pytest.mark.parametrize(("expression", "expected"), EXPRESSIONS.items())
def test_an_expression_by_hand_on_every_kind_of_number(expression: str, expected: float) -> None:
    task = margin_task(expression)
    found = first_margin(task, STATE, None)
    assert type(found) is float
    assert found == pytest.approx(expected, rel=1e-12)
    batch = {
        name: np.broadcast_to(value, (2, 4, *np.shape(value))) for name, value in STATE.items()
    }
    for convert, tolerance in ((np.asarray, 1e-12), (jnp.asarray, 1e-5)):
        signals = {name: convert(value) for name, value in batch.items()}
        margin = first_margin(task, signals, namespace_of(signals.values()))
        assert margin.shape == (2, 4)
        np.testing.assert_allclose(margin, expected, rtol=tolerance, atol=tolerance)
    signals = {name: torch.asarray(np.array(value)) for name, value in batch.items()}
    margin = first_margin(task, signals, torch_xp)
    assert tuple(margin.shape) == (2, 4)
    np.testing.assert_allclose(margin, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("z ** 0.5", -0.0),
        ("sqrt(z)", -0.0),
        ("z ** 2", 0.0),
        ("z ** 3", -0.0),
        ("z ** -1", -math.inf),
        ("z ** -3", -math.inf),
        ("z ** -2", math.inf),
        ("z ** -0.5", math.inf),
        ("atan2(z, -1)", -math.pi),
        ("atan2(0, z ** 0.5)", math.pi),
    ],
)
def test_a_negative_zero_gives_the_same_on_floats_and_arrays(
    expression: str, expected: float
) -> None:
    # Ranges that leave 0 out, so that a pole is legal: values outside of a range are.
    low = (
        -1
        if "atan2(z" in expression
        else 0
        if "0.5" in expression and "-0" not in expression
        else 1
    )
    task = parse_task(f"signal z in [{low}, 2]\nensure r: {expression} >= 0 or z <= 5")
    found = first_margin(task, {"z": -0.0}, None)
    with np.errstate(all="ignore"):
        array = first_margin(task, {"z": np.asarray([-0.0])}, np).item()
    assert (found, math.copysign(1.0, found)) == (array, math.copysign(1.0, array))
    assert found == pytest.approx(expected)


@pytest.mark.parametrize(
    ("relation", "margin"), [("<=", 2.5), ("<", 2.5), (">=", -2.5), (">", -2.5)]
)
def test_a_margin_is_positive_where_the_comparison_holds(relation: str, margin: float) -> None:
    task = parse_task(f"{HEADER}ensure r: x {relation} y")
    assert first_margin(task, STATE, None) == margin


def test_a_comparison_without_signals_has_a_constant_margin() -> None:
    task = parse_task(f"{HEADER}ensure r: k >= 1")
    assert first_margin(task, STATE, None) == 2.0
    assert first_margin(task, {"x": np.zeros(3)}, np) == 2.0


def test_definitions_that_no_comparison_uses_are_not_computed() -> None:
    task = parse_task(HEADER + "ensure r: x <= 1")
    compiled = compile_margins(task, comparisons(task.requirements[0].predicate), None)
    assert compiled.definitions == ()
    assert compiled({"x": 0.5}) == [0.5]


def test_a_definition_used_twice_is_computed_once_and_leaves_the_signals_alone() -> None:
    task = margin_task("sum_of_two * sum_of_two")
    leaf = comparisons(task.requirements[0].predicate)[0]
    compiled = compile_margins(task, [leaf], None)
    assert [name for name, _ in compiled.definitions] == ["sum_of_two"]
    signals = dict(STATE)
    compiled(signals)
    assert signals.keys() == STATE.keys()


def test_definitions_may_be_constant_and_may_build_on_each_other() -> None:
    task = parse_task(
        "signal x in [-2, 2]\nconst k = 3\nlet limit = k / 2\nlet off = abs(x - limit)\n"
        "let far = off + off in [0, 5]\nensure r: far <= 2 * limit"
    )
    # off = 0.5, far = 1, limit = 1.5
    assert first_margin(task, {"x": 1.0}, None) == 2.0
    assert first_margin(task, {"x": np.asarray([1.0])}, np).tolist() == [2.0]


def test_used_signals_come_in_the_order_of_the_text() -> None:
    task = parse_task(
        "signal c in [0, 1]\nsignal idle in [0, 1]\nsignal b in [0, 1]\nsignal a in [0, 1]\n"
        "let d = b\nensure r: a + c <= 1"
    )
    assert used_signals(task) == ("c", "b", "a")


def test_nothing_of_a_task_is_ever_executed() -> None:
    """No eval, exec, compile or import by name, and no attribute named by a value."""
    root = Path(hprs.__file__).parent
    files = [p for part in ("spec", "semantics", "rewards") for p in (root / part).glob("*.py")]
    assert len(files) > 15
    for path in files:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                name = node.func.id
                assert name not in {"eval", "exec", "compile", "__import__"}, path
                if name in {"getattr", "setattr", "hasattr"} and path.name != "task.py":
                    assert isinstance(node.args[1], ast.Constant), (path, node.lineno)
