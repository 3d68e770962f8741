from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest

from hprs.errors import SpecTypeError, SpecValidationError
from hprs.spec.expression import (
    MAX_DEPTH,
    And,
    Binary,
    Call,
    Comparison,
    Expression,
    Name,
    Negate,
    Number,
    Operand,
    Or,
    as_expression,
    call,
)
from hprs.spec.parser import parse_task
from hprs.spec.task import Constant, Definition, Signal
from hprs.spec.traversal import comparisons, names

X, Y, Z = Name("x"), Name("y"), Name("z")
SIGNALS = "signal x in [0.5, 2]\nsignal y in [0.5, 2]\nsignal z in [0.5, 2]\n"


@pytest.mark.parametrize(
    ("built", "text"),
    [
        (X + Y, "x + y"),
        (X + 1, "x + 1"),
        (1 + X, "1 + x"),
        (X - 1, "x - 1"),
        (1 - X, "1 - x"),
        (X * 2, "x * 2"),
        (2 * X, "2 * x"),
        (X / 2, "x / 2"),
        (2 / X, "2 / x"),
        (X**2, "x ** 2"),
        (2**X, "2 ** x"),
        (+X, "x"),
        (+Signal("x", 0, 1), "x"),
        (-X, "-x"),
        (abs(X), "abs(x)"),
        (-(X + Y) * 2, "-(x + y) * 2"),
        (X - -1, "x - -1"),
        (call("hypot", X, 2), "hypot(x, 2)"),
        (as_expression(-0.5), "-0.5"),
        (as_expression(np.float64(0.5)), "0.5"),
    ],
)
def test_python_operators_build_what_the_text_says(built: Expression, text: str) -> None:
    assert parse_task(f"{SIGNALS}let e = {text}").definitions[0].value == built


@pytest.mark.parametrize(
    ("built", "text"),
    [
        (X <= 1, "x <= 1"),
        (X < Y, "x < y"),
        (X >= 1, "x >= 1"),
        (X > 1, "x > 1"),
        ((X <= 1) & (Y <= 1), "x <= 1 and y <= 1"),
        ((X <= 1) | (Y <= 1), "x <= 1 or y <= 1"),
        (((X <= 1) | (Y <= 1)) & (Z <= 1), "(x <= 1 or y <= 1) and z <= 1"),
        (((X <= 1) & (Y <= 1)) & (Z <= 1), "x <= 1 and y <= 1 and z <= 1"),
        ((X <= 1) | ((Y <= 1) | (Z <= 1)), "x <= 1 or y <= 1 or z <= 1"),
    ],
)
def test_python_predicates_build_what_the_text_says(
    built: Comparison | And | Or, text: str
) -> None:
    assert parse_task(f"{SIGNALS}ensure r: {text}").requirements[0].predicate == built


def test_signals_constants_and_definitions_stand_for_their_names() -> None:
    declared = (Signal("x", 0, 1), Constant("x", Number(1.0)), Definition("x", Number(1.0)))
    for operand in declared:
        assert operand.expression() == X
        assert operand + 1 == X + 1
        assert (operand <= 1) == (X <= 1)


def test_an_operand_of_no_kind_has_no_expression() -> None:
    with pytest.raises(NotImplementedError):
        Operand().expression()


@pytest.mark.parametrize("value", [math.nan, -1.0, -0.0, math.inf, 10**400])
def test_a_number_is_finite_and_not_negative(value: float) -> None:
    with pytest.raises(SpecValidationError, match="must be finite and not negative"):
        Number(value)


@pytest.mark.parametrize(
    ("value", "expression"),
    [
        (2, Number(2.0)),
        (-2.5, Negate(Number(2.5))),
        (-0.0, Negate(Number(0.0))),
        (math.inf, Name("inf")),
        (-math.inf, Negate(Name("inf"))),
    ],
)
def test_python_numbers_become_expressions(value: float, expression: Expression) -> None:
    assert as_expression(value) == expression


@pytest.mark.parametrize(
    "value", ["x", None, True, np.bool_(True), 1j, [1.0], np.zeros(2), Decimal(1), X <= 1]
)
def test_other_python_values_do_not(value: object) -> None:
    for build in (as_expression, X.__add__, X.__le__):
        with pytest.raises(SpecTypeError, match="expected a number or an expression, got"):
            build(value)  # type: ignore[arg-type]


def test_an_array_meets_an_operand_as_a_whole() -> None:
    with pytest.raises(SpecTypeError, match="expected a number or an expression, got array"):
        _ = np.zeros(2) * X  # type: ignore[operator]


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int64, np.uint8, Fraction])
def test_every_real_number_is_a_number_on_both_sides(kind: Callable[[int], float]) -> None:
    two = kind(2)
    assert as_expression(two) == Number(2.0)
    assert two * X == 2 * X  # type: ignore[operator]
    assert X**two == X**2
    assert (two <= X) == (two <= X) == (X >= 2)  # type: ignore[operator]
    assert Signal("x", two, 3).low == Number(2.0)


def test_nan_and_integers_beyond_the_floats_are_refused() -> None:
    with pytest.raises(SpecValidationError, match="finite"):
        as_expression(math.nan)
    with pytest.raises(SpecValidationError, match="too large"):
        as_expression(10**400)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: call("eval", X), "unknown function 'eval'"),
        (lambda: call("abs"), r"abs\(\) takes 1 argument, got 0"),
        (lambda: call("min"), r"min\(\) takes at least 1 arguments, got 0"),
        (lambda: call("atan2", X), r"atan2\(\) takes 2 arguments, got 1"),
        (lambda: Call(3, (X,)), "unknown function '3'"),  # type: ignore[arg-type]
        (lambda: Call("abs", X), "Call needs expressions, got Name"),  # type: ignore[arg-type]
        (
            lambda: Comparison(X, "==", Number(0.5)),  # type: ignore[arg-type]
            r"a relation is one of <=, <, >=, >, got '=='\. .* write abs\(a - b\) <= tolerance",
        ),
        (lambda: Comparison(X, "=<", Y), "a relation is one of .*, got '=<'"),  # type: ignore[arg-type]
        (lambda: Comparison(X, None, Y), "a relation is one of .*, got None"),  # type: ignore[arg-type]
        (lambda: Binary("%", X, Y), r"an operator is one of \+, -, \*, /, \*\*, got '%'"),  # type: ignore[arg-type]
        (lambda: Binary([], X, Y), r"an operator is one of .*, got \[\]"),  # type: ignore[arg-type]
        (lambda: Name(3), "a name is a text, got 3"),  # type: ignore[arg-type]
        (lambda: Number("3"), "expected a number or an expression, got '3'"),  # type: ignore[arg-type]
        (lambda: Number(True), "expected a number or an expression, got True"),
        (lambda: And(X <= 1), "and / or need a tuple of conditions, got Comparison"),  # type: ignore[arg-type]
        (lambda: And((X <= 1,)), "at least two parts"),
        (lambda: Or(()), "at least two parts"),
    ],
)
def test_malformed_nodes_are_refused(build: Callable[[], object], message: str) -> None:
    with pytest.raises(SpecValidationError, match=message):
        build()


@pytest.mark.parametrize(
    "build",
    [
        lambda: (X <= 1) & (X == 1),
        lambda: (X == 1) & (X <= 1),
        lambda: (X <= 1) | (X == 1),
        lambda: (X == 1) | (X <= 1),
        lambda: And((X <= 1, False)),  # type: ignore[arg-type]
    ],
)
def test_an_equality_is_no_part_of_a_predicate(build: Callable[[], object]) -> None:
    with pytest.raises(SpecTypeError, match=r"got False. There is no ==.*abs\(a - b\) <= tol"):
        build()


def test_an_expression_is_no_part_of_a_predicate() -> None:
    with pytest.raises(SpecTypeError, match=r"need a comparison such as x <= 1, got Binary\("):
        _ = (X <= 1) & (X + 1)  # type: ignore[operator]


@pytest.mark.parametrize(
    "build",
    [
        lambda: Comparison(Signal("x", 0, 1), "<=", Number(1.0)),  # type: ignore[arg-type]
        lambda: Negate(1.0),  # type: ignore[arg-type]
        lambda: Binary("+", X, "y"),  # type: ignore[arg-type]
        lambda: Call("abs", (1,)),  # type: ignore[arg-type]
        lambda: Binary("+", X <= 1, X),  # type: ignore[arg-type]
    ],
)
def test_a_node_has_nodes_below_it(build: Callable[[], object]) -> None:
    with pytest.raises(SpecTypeError, match=r"needs expressions, got .* Build it with operators"):
        build()


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: X % 2, "expressions have no % and no //"),
        (lambda: 7 % X, "expressions have no % and no //"),
        (lambda: X // 2, "expressions have no % and no //"),
        (lambda: math.sin(X), r'Write hprs.call\("sin", x\) instead of math.sin\(x\)'),
        (lambda: ~(X <= 1), "there is no ~. Turn the comparison round"),
    ],
)
def test_what_python_has_and_the_language_has_not_is_said(
    build: Callable[[], object], message: str
) -> None:
    with pytest.raises(SpecTypeError, match=message):
        build()


def test_a_predicate_is_no_truth_value() -> None:
    with pytest.raises(SpecTypeError, match="no truth value"):
        bool(X <= 1)
    with pytest.raises(SpecTypeError, match="no truth value"):
        _ = 0 <= X <= 1  # type: ignore[operator]


def nested(depth: int) -> Expression:
    expression: Expression = X
    for _ in range(depth - 1):
        expression = Negate(expression)
    return expression


def test_depth_is_bounded_for_every_kind_of_node() -> None:
    deepest = nested(MAX_DEPTH)
    assert deepest.depth == MAX_DEPTH
    for build in (
        lambda: Negate(deepest),
        lambda: Binary("+", deepest, X),
        lambda: Binary("+", X, deepest),
        lambda: Call("min", (X, deepest)),
        lambda: Comparison(X, "<=", deepest),
        lambda: And((X <= 1, Comparison(nested(MAX_DEPTH - 1), "<=", X))),
    ):
        with pytest.raises(SpecValidationError, match="nested deeper than 100"):
            build()


def test_the_deepest_expression_can_be_compared_hashed_shown_copied_and_pickled() -> None:
    deepest = nested(MAX_DEPTH)
    assert deepest == nested(MAX_DEPTH)
    assert hash(deepest) == hash(nested(MAX_DEPTH))
    assert repr(deepest).count("Negate") == MAX_DEPTH - 1
    assert copy.deepcopy(deepest) == pickle.loads(pickle.dumps(deepest)) == deepest
    assert names(deepest) == {"x"}


def test_arguments_are_frozen_into_a_tuple() -> None:
    assert Call("min", [X, Y]) == Call("min", (X, Y))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("comparison", "margin", "strict"),
    [
        (X <= Y, Y - X, False),
        (X < Y, Y - X, True),
        (X >= Y, X - Y, False),
        (X > Y, X - Y, True),
    ],
)
def test_a_margin_is_positive_when_the_comparison_holds(
    comparison: Comparison, margin: Binary, *, strict: bool
) -> None:
    assert comparison.margin == margin
    assert comparison.strict == strict


def test_comparisons_are_listed_from_left_to_right() -> None:
    predicate = ((X <= 1) | ((Y <= 1) & (Z <= 1))) & (X >= 0)
    assert comparisons(predicate) == (X <= 1, Y <= 1, Z <= 1, X >= 0)


def test_names_leave_out_numbers_and_builtin_constants() -> None:
    predicate = (call("max", X, 2) <= Name("pi")) | (-Y / Name("deg") <= Z)
    assert names(predicate) == {"x", "y", "z"}
