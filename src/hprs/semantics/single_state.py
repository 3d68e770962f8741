"""Evaluates one state of Python floats: the fast path of a single environment.

An environment's own step takes some tens of microseconds and evicts everything else from the
processor's caches. What counts is therefore the amount of code a step runs through, not only its
instructions: one loop, over closures that the compiler made.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias, cast

from hprs.semantics.plan import Evaluation, Plan
from hprs.spec.compiler import compile_margins
from hprs.spec.namespace import float_operations

Values: TypeAlias = Any
Triple: TypeAlias = tuple[float, bool, float]
"""Margin, satisfaction and score of a row or of a part of it."""
RowFunction: TypeAlias = Callable[[Values], Triple]

# Twice as fast as the named constructor.
_new_evaluation: Callable[..., Evaluation] = cast(Any, tuple).__new__

_STEP = -5e-324
"""The lower bound that makes the continuous score binary: the negative number closest to 0."""


def float_evaluator(plan: Plan) -> Callable[[Mapping[str, Any]], Evaluation]:
    """A function that evaluates one state from its signals.

    Scalars are floats, vectors NumPy arrays.
    """
    margins = compile_margins(plan.task, plan.leaves, None)
    definitions = margins.definitions
    rows = _rows(plan, margins.functions)
    # In a chain of groups one running product is the weight of the next group.
    is_chain = _is_chain(plan)
    levels = [[rows[row] for row in group.members] for group in plan.groups] if is_chain else [rows]

    def evaluate(signals: Mapping[str, Any]) -> Evaluation:
        values: Any = signals
        if definitions:
            values = dict(signals)
            for name, function in definitions:
                values[name] = function(values)
        found: list[float] = []
        satisfied: list[bool] = []
        scores: list[float] = []
        potential, weight = 0.0, 1.0
        for level in levels:
            total, product = 0.0, 1.0
            for function, low, special in level:
                if special is not None:
                    margin, holds, score = special(values)
                else:
                    margin = function(values)
                    holds = margin >= 0.0
                    # max() keeps NaN, which must not turn into a score.
                    score = 1.0 if holds else max(1.0 - margin / low, 0.0)
                found.append(margin)
                satisfied.append(holds)
                scores.append(score)
                total += score
                product *= score
            potential += weight * total
            weight *= product
        if not is_chain:
            potential = _general(plan, scores)
        return _new_evaluation(Evaluation, (found, satisfied, scores, potential))

    return evaluate


def _rows(plan: Plan, functions: tuple[Any, ...]) -> list[tuple[Any, float, RowFunction | None]]:
    """For each row its margin function and lower bound, or a function that says all of it.

    The second is for strict comparisons, and for `and` / `or`.
    """
    lows = [_STEP] * plan.safety_leaves + list(plan.soft_lows)
    leaves = [
        _leaf(function, strict, low)
        for function, strict, low in zip(functions, plan.strict, lows, strict=True)
    ]
    combined = plan.combine(leaves, _lift("min", all), _lift("max", any))
    singles = plan.combine(list(range(len(leaves))), lambda a, b: -1, lambda a, b: -1)
    rows: list[tuple[Any, float, RowFunction | None]] = []
    for row, (leaf, whole) in enumerate(zip(singles, combined, strict=True)):
        if leaf < 0 or plan.strict[leaf]:
            special = _binary(whole) if row < plan.safety_count else whole
            rows.append((None, math.nan, special))
        else:
            rows.append((functions[leaf], lows[leaf], None))
    return rows


def _leaf(function: Any, strict: bool, low: float) -> RowFunction:
    def leaf(values: Values) -> Triple:
        margin = function(values)
        holds = margin > 0.0 if strict else margin >= 0.0
        return margin, holds, 1.0 if margin >= 0.0 else max(1.0 - margin / low, 0.0)

    return leaf


def _binary(whole: RowFunction) -> RowFunction:
    def safety(values: Values) -> Triple:
        margin, holds, _ = whole(values)
        return margin, holds, 1.0 if holds else 0.0 if margin <= 0.0 else math.nan

    return safety


def _lift(
    extremum: str, connective: Callable[[tuple[bool, bool]], bool]
) -> Callable[[RowFunction, RowFunction], RowFunction]:
    pick = float_operations()[extremum]

    def combine(f: RowFunction, g: RowFunction) -> RowFunction:
        def both_parts(values: Values) -> Triple:
            a, b = f(values), g(values)
            return pick(a[0], b[0]), connective((a[1], b[1])), pick(a[2], b[2])

        return both_parts

    return combine


def _is_chain(plan: Plan) -> bool:
    members = [row for group in plan.groups for row in group.members]
    above: list[int] = []
    for group in plan.groups:
        if list(group.above) != above:
            return False
        above.extend(group.members)
    return members == list(range(len(plan.rows)))


def _general(plan: Plan, scores: list[float]) -> float:
    return sum(
        math.prod(scores[row] for row in group.above) * sum(scores[row] for row in group.members)
        for group in plan.groups
    )
