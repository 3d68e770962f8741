"""Evaluates one state of Python floats: the fast path of a single environment.

An environment's own step takes some tens of microseconds and evicts everything else from the
processor's caches. What counts is therefore the amount of code a step runs through, not only its
instructions: closures that the compiler made, in loops without special cases.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeAlias, cast

from hprs.semantics.plan import Evaluation, Plan
from hprs.spec.compiler import compile_margins
from hprs.spec.namespace import float_operations

Values: TypeAlias = Any
Triple: TypeAlias = tuple[float, bool, float]
"""Margin, satisfaction and score of a row or of a part of it."""
RowFunction: TypeAlias = Callable[[Values], Triple]
Evaluator: TypeAlias = Callable[[Mapping[str, Any]], Evaluation]

# Twice as fast as the named constructor.
_new_evaluation: Callable[..., Evaluation] = cast(Any, tuple).__new__


def float_evaluator(plan: Plan) -> Evaluator:
    """A function that evaluates one state from its signals.

    Scalars are floats, vectors NumPy arrays.
    """
    margins = compile_margins(plan.task, plan.leaves, None)
    make = _class_by_class if _is_plain(plan) else _row_by_row
    evaluate = make(plan, margins.functions)
    if not margins.definitions:
        return evaluate

    def define_and_evaluate(signals: Mapping[str, Any]) -> Evaluation:
        values = dict(signals)
        for name, function in margins.definitions:
            values[name] = function(values)
        return evaluate(values)

    return define_and_evaluate


def _is_plain(plan: Plan) -> bool:
    """Whether every row is one comparison, none strict, and only the classes order them."""
    return not (
        plan.compound
        or plan.any_strict
        or plan.task.preferences
        or -math.inf in plan.soft_lows  # such a row always holds
    )


def _class_by_class(plan: Plan, functions: tuple[Any, ...]) -> Evaluator:
    rows = list(zip(plan.labels, functions, strict=True))
    safety, soft = rows[: plan.safety_count], rows[plan.safety_count :]
    with_lows = [(*row, low) for row, low in zip(soft, plan.soft_lows, strict=True)]
    targets = with_lows[: plan.comfort_start - plan.safety_count]
    comfort = with_lows[len(targets) :]

    def evaluate(values: Values) -> Evaluation:
        margins: dict[str, float] = {}
        satisfied: list[bool] = []
        scores: dict[str, float] = {}
        potential, weight = 0.0, 1.0
        for label, function in safety:
            margins[label] = margin = function(values)
            if margin >= 0.0:
                satisfied.append(True)
                scores[label] = 1.0
                potential += 1.0
            else:
                satisfied.append(False)
                # NaN must not turn into a score.
                scores[label] = score = 0.0 if margin < 0.0 else margin
                weight *= score
                potential += score
        for label, function, low in targets:
            margins[label] = margin = function(values)
            if margin >= 0.0:
                satisfied.append(True)
                scores[label] = 1.0
                potential += weight
            else:
                satisfied.append(False)
                # max() keeps NaN where it comes first.
                scores[label] = score = max(1.0 - margin / low, 0.0)
                weight *= score
                potential += weight
        total = 0.0
        for label, function, low in comfort:
            margins[label] = margin = function(values)
            if margin >= 0.0:
                satisfied.append(True)
                scores[label] = 1.0
                total += 1.0
            else:
                satisfied.append(False)
                scores[label] = score = max(1.0 - margin / low, 0.0)
                total += score
        potential += weight * total
        return _new_evaluation(Evaluation, (margins, satisfied, scores, potential))

    return evaluate


def _row_by_row(plan: Plan, functions: tuple[Any, ...]) -> Evaluator:
    lows = [-math.inf] * plan.safety_leaves + list(plan.soft_lows)
    leaves = [
        _leaf(function, strict, low)
        for function, strict, low in zip(functions, plan.strict, lows, strict=True)
    ]
    rows = plan.combine(leaves, _connective("min", all), _connective("max", any))
    rows[: plan.safety_count] = [_binary(row) for row in rows[: plan.safety_count]]

    def evaluate(values: Values) -> Evaluation:
        margins, satisfied, scores = zip(*[row(values) for row in rows], strict=True)
        potential = sum(
            math.prod(scores[row] for row in group.above)
            * sum(scores[row] for row in group.members)
            for group in plan.groups
        )
        by_label = dict(zip(plan.labels, margins, strict=True))
        scores_by_label = dict(zip(plan.labels, scores, strict=True))
        return Evaluation(by_label, list(satisfied), scores_by_label, potential)

    return evaluate


def _leaf(function: Any, strict: bool, low: float) -> RowFunction:
    def leaf(values: Values) -> Triple:
        margin = function(values)
        holds = margin > 0.0 if strict else margin >= 0.0
        if margin >= 0.0 or (low == -math.inf and margin < 0.0):
            return margin, holds, 1.0
        return margin, holds, max(1.0 - margin / low, 0.0)

    return leaf


def _binary(whole: RowFunction) -> RowFunction:
    def safety(values: Values) -> Triple:
        margin, holds, _ = whole(values)
        return margin, holds, 1.0 if holds else 0.0 if margin <= 0.0 else math.nan

    return safety


def _connective(
    extremum: str, holds: Callable[[Iterable[bool]], bool]
) -> Callable[[Sequence[RowFunction]], RowFunction]:
    pick = float_operations()[extremum]

    def combine(parts: Sequence[RowFunction]) -> RowFunction:
        # One closure for all parts: a pair of closures a part would recurse as deep as they are.
        def whole(values: Values) -> Triple:
            margins, satisfied, scores = zip(*[part(values) for part in parts], strict=True)
            return pick(*margins), holds(satisfied), pick(*scores)

        if len(parts) != 2:
            return whole
        first, second = parts

        def pair(values: Values) -> Triple:  # what most are, without lists
            a, b = first(values), second(values)
            return pick(a[0], b[0]), holds((a[1], b[1])), pick(a[2], b[2])

        return pair

    return combine
