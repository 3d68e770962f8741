from __future__ import annotations

import pytest
from hypothesis import given

from hprs.spec.expression import And, Binary, Call, Comparison, Name, Negate, Number, Or
from hprs.spec.parser import parse_task
from hprs.spec.printer import format_expression, format_predicate, format_task
from hprs.spec.task import Task
from tests.strategies import tasks

X, Y, Z = Name("x"), Name("y"), Name("z")
DEG = Name("deg")


@given(tasks())
def test_a_printed_task_parses_to_the_same_task(task: Task) -> None:
    assert parse_task(format_task(task)) == task


@given(tasks())
def test_printing_is_stable(task: Task) -> None:
    text = format_task(task)
    assert format_task(parse_task(text)) == text


@pytest.mark.parametrize(
    ("expression", "text"),
    [
        (Binary("-", X, Binary("-", Y, Z)), "x - (y - z)"),
        (Binary("-", Binary("-", X, Y), Z), "x - y - z"),
        (Binary("*", Binary("+", X, Y), Z), "(x + y) * z"),
        (Binary("+", X, Binary("*", Y, Z)), "x + y * z"),
        (Binary("/", X, Binary("*", Y, Z)), "x / (y * z)"),
        (Binary("*", X, Negate(Y)), "x * -y"),
        (Binary("**", Negate(X), Number(2.0)), "(-x) ** 2"),
        (Negate(Binary("**", X, Number(2.0))), "-x ** 2"),
        (Binary("**", X, Negate(Number(1.0))), "x ** -1"),
        (Binary("**", X, Binary("**", Y, Z)), "x ** y ** z"),
        (Binary("**", Binary("**", X, Y), Z), "(x ** y) ** z"),
        (Negate(Negate(X)), "--x"),
        (Negate(Binary("+", X, Y)), "-(x + y)"),
        (Call("clip", (X, Negate(Y), Binary("+", Y, Z))), "clip(x, -y, y + z)"),
        (Binary("*", Number(12.0), DEG), "12 deg"),
        (Negate(Binary("*", Number(12.0), DEG)), "-12 deg"),
        (Binary("*", Negate(Number(12.0)), DEG), "-12 * deg"),
        (Binary("**", Binary("*", Number(12.0), DEG), Number(2.0)), "(12 deg) ** 2"),
        (Binary("*", X, Binary("*", Number(12.0), DEG)), "x * 12 deg"),
        (Binary("*", Binary("*", X, Number(12.0)), DEG), "x * 12 * deg"),
    ],
)
def test_expressions_print_with_minimal_parentheses(expression: Binary, text: str) -> None:
    assert format_expression(expression) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (2.0, "2"),
        (0.0, "0"),
        (0.1, "0.1"),
        (1e15, "1000000000000000"),
        (1e16, "1e16"),
        (1e-7, "1e-07"),
        (0.1 + 0.2, "0.30000000000000004"),
        (1.7976931348623157e308, "1.7976931348623157e308"),
    ],
)
def test_numbers_print_exactly(value: float, text: str) -> None:
    assert format_expression(Number(value)) == text
    assert float(text) == value


A, B, C = (Comparison(name, "<=", Number(1.0)) for name in (X, Y, Z))


@pytest.mark.parametrize(
    ("predicate", "text"),
    [
        (Or((And((A, B)), C)), "x <= 1 and y <= 1 or z <= 1"),
        (And((Or((A, B)), C)), "(x <= 1 or y <= 1) and z <= 1"),
        (And((A, Or((B, C)))), "x <= 1 and (y <= 1 or z <= 1)"),
        (And((Comparison(Y, "<", X), Comparison(X, "<=", Z))), "y < x <= z"),
        (And((Comparison(Y, ">", X), Comparison(X, ">=", Z), A)), "y > x >= z and x <= 1"),
        (And((Comparison(Y, "<", X), Comparison(X, ">", Z))), "y < x and x > z"),
    ],
)
def test_predicates_print_with_minimal_parentheses(predicate: And | Or, text: str) -> None:
    assert format_predicate(predicate) == text


def test_statements_print_in_groups_in_the_order_of_their_use() -> None:
    text = (
        "const top = 3\n\n"
        'signal x = obs.pose[0] initially 0 in [-top, top] "m"\n'
        "signal v[3] = action[:3] in [0, inf]\n\n"
        "let d = max(v) in [0, 10]\n\n"
        "ensure near: abs(x) <= 2\n"
        "encourage calm: d <= 1\n\n"
        "prefer near over calm\n"
    )
    assert format_task(parse_task(text)) == text


def test_an_empty_task_prints_as_nothing() -> None:
    assert format_task(Task()) == ""
