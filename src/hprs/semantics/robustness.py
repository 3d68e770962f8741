"""Robustness of a task's requirements: the quantitative semantics of signal temporal logic.

A requirement is a formula over an episode s_0 .. s_t: `ensure` and `encourage` ask "always",
`achieve` "eventually", `conquer` "eventually always". Its robustness is the minimum or maximum of
margins over time; on an ended episode "eventually always" is the margin of the last state.
Everything is followed step by step, with memory and time that do not grow with the episode.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, TypeAlias, get_args

from hprs.errors import UsageError, did_you_mean
from hprs.semantics.evaluation import Signals, column, evaluate, is_single, leaf_margins, pick
from hprs.semantics.plan import Plan, plan_of
from hprs.semantics.trace import check_trace
from hprs.spec.compiler import compile_margins
from hprs.spec.interval import Interval
from hprs.spec.misuse import shown
from hprs.spec.namespace import (
    Array,
    Operations,
    array_operations,
    float_operations,
    namespace_of,
)
from hprs.spec.task import Task, require_task
from hprs.spec.vocabulary import Kind

MarginForm: TypeAlias = Literal["normalised", "raw"]
MARGIN_FORMS: tuple[MarginForm, ...] = get_args(MarginForm)
"""Margins as they are, or each comparison's divided by its bound on the same side of 0 and clipped
to [-1, 1], so that metres never outweigh radians; below 0 that is the score minus 1."""

Operator: TypeAlias = Literal["always", "eventually", "eventually always"]
OPERATORS: Mapping[Kind, Operator] = MappingProxyType(
    {
        "ensure": "always",
        "achieve": "eventually",
        "conquer": "eventually always",
        "encourage": "always",
    }
)
"""What a requirement asks of an episode."""


class Part(NamedTuple):
    """Rows under one temporal operator; together they count as the least robust of them."""

    operator: Operator
    rows: tuple[int, ...]


class RowMargins(NamedTuple):
    """Margins of the first rows of a plan in one state, or in a batch of states."""

    rows: Sequence[Any]
    """A list of floats, or an array with the rows on its first axis."""
    operations: Operations
    """`min` and `max` of such values."""

    def least(self, rows: Sequence[int]) -> Array:
        """The smallest of some rows."""
        return self.operations["min"](*[self.rows[row] for row in rows])


def check_margin_form(
    task: Task, form: str, *, rows: int | None = None, instead: str = "margins='raw'"
) -> None:
    """Refuse a form of margins that a task's rows do not have.

    Args:
        task: The task.
        form: One of `MARGIN_FORMS`.
        rows: How many of its plan's rows, from the first on; None: all.
        instead: What to choose for margins without bounds.

    Raises:
        UsageError: The form is unknown, or a margin that would be normalised has an infinite bound.
    """
    if form not in MARGIN_FORMS:
        raise UsageError(
            f"margins are {' or '.join(MARGIN_FORMS)}, got {shown(form)}."
            f"{did_you_mean(str(form), MARGIN_FORMS)}"
        )
    if form == "raw":
        return
    for label in plan_of(task).labels[:rows]:
        for leaf in task.analysis.leaves[label]:
            if not (math.isfinite(leaf.low) and math.isfinite(leaf.high)):
                raise UsageError(
                    f"the margin of requirement '{label}' has the bounds {leaf}, which cannot "
                    f"normalise it. Give its signals finite ranges, or choose {instead}."
                )


def row_margins(task: Task, signals: Signals, form: MarginForm, rows: int) -> RowMargins:
    """The margins of the first rows of a task's plan; see `MARGIN_FORMS`."""
    evaluation = evaluate(task, signals)
    if is_single(evaluation):
        if form == "raw":
            return RowMargins(list(evaluation.margins.values())[:rows], float_operations())
        normalise = _float_normaliser(task, rows)
        return RowMargins(normalise(signals, evaluation.margins), float_operations())
    xp = namespace_of((evaluation.margins,))
    if form == "raw":
        return RowMargins(evaluation.margins[:rows], array_operations(xp))
    plan = plan_of(task)
    if not plan.compound:
        scaled = _scaled(plan, evaluation.margins, slice(rows))
        return RowMargins(scaled, array_operations(xp))
    leaves = _scaled(plan, leaf_margins(plan, pick(plan, signals), xp), slice(None))
    operations = array_operations(xp)
    return RowMargins(_combined(plan, leaves, operations)[:rows], operations)


def row_truths(task: Task, signals: Signals, rows: int) -> RowMargins:
    """For the first rows of a task's plan 1 where they are satisfied, strictness included, or 0."""
    evaluation = evaluate(task, signals)
    if is_single(evaluation):
        return RowMargins(list(map(float, evaluation.satisfied[:rows])), float_operations())
    xp = namespace_of((evaluation.satisfied,))
    truths = xp.astype(evaluation.satisfied[:rows], evaluation.potential.dtype)
    return RowMargins(truths, array_operations(xp))


def begin(parts: Sequence[Part], margins: RowMargins) -> tuple[Array, ...]:
    """The robustness of every part over s_0 alone."""
    return tuple([margins.least(part.rows) for part in parts])


def advance(
    parts: Sequence[Part], running: tuple[Array, ...], margins: RowMargins
) -> tuple[Array, ...]:
    """The robustness of every part over the episode so far, one state later."""
    now = begin(parts, margins)
    operations = margins.operations
    return tuple(
        [
            value
            if part.operator == "eventually always"
            else operations["min" if part.operator == "always" else "max"](before, value)
            for part, before, value in zip(parts, running, now, strict=True)
        ]
    )


def formula(task: Task) -> tuple[Part, ...]:
    """The task as one formula, a conjunction of these parts: safety and target, without comfort."""
    plan = plan_of(task)
    parts: list[Part] = []
    if plan.safety_count:
        parts.append(Part("always", tuple(range(plan.safety_count))))
    if plan.target_row is not None:
        kind = plan.rows[plan.target_row].kind
        parts.append(Part(OPERATORS[kind], (plan.target_row,)))
    return tuple(parts)


def require_formula(task: Task, reward: str) -> None:
    """Refuse a task that a formula of safety and target says nothing of.

    Raises:
        UsageError: It has neither safety nor target requirements.
    """
    if not formula(require_task(task)):
        raise UsageError(
            f"{reward} pays for safety and target requirements, and this task has none. Add an "
            "ensure, achieve or conquer."
        )


def robustness(task: Task, trace: Signals, *, margins: MarginForm = "raw") -> dict[str, Array]:
    """Label to the robustness of a requirement over a whole trace, or a batch of them.

    Args:
        task: The task.
        trace: Signal name to values, s_0 first; time on the first axis, batch axes after it.
        margins: See `MARGIN_FORMS`.

    Raises:
        TraceError: See `hprs.assess`.
        UsageError: See `check_margin_form`.
    """
    check_margin_form(require_task(task), margins)
    plan = plan_of(task)
    values = check_trace(plan, trace)
    xp = namespace_of(values.values())
    found: list[Array] = []
    for row, over_time in zip(
        plan.rows, row_margins(task, values, margins, len(plan.rows)).rows, strict=True
    ):
        operator = OPERATORS[row.kind]
        if operator == "eventually always":
            found.append(over_time[-1])
        else:
            reduction = xp.min if operator == "always" else xp.max
            found.append(reduction(over_time, axis=0))
    return plan.by_label(found)


def _scale(leaf: Interval) -> tuple[float, float]:
    """Distances from 0 to the bounds of a margin; one that lies at or beyond 0 is the other's."""
    below, above = -leaf.low, leaf.high
    return (
        below if below > 0.0 else above if above > 0.0 else 1.0,
        above if above > 0.0 else below if below > 0.0 else 1.0,
    )


def _scaled(plan: Plan, leaves: Array, kept: slice) -> Array:
    """Margins of the leaves, normalised."""
    xp = namespace_of((leaves,))
    leaves = leaves[kept]
    below, above = zip(*map(_scale, plan.ranges[kept]), strict=True)
    limit, least, most = array_operations(xp), column(below, leaves, xp), column(above, leaves, xp)
    scaled = xp.where(leaves >= 0.0, leaves / most, leaves / least)
    return limit["clip"](scaled, -1.0, 1.0)


def _combined(plan: Plan, leaves: Sequence[Array], operations: Operations) -> list[Array]:
    least, most = operations["min"], operations["max"]
    return plan.combine(leaves, lambda parts: least(*parts), lambda parts: most(*parts))


@lru_cache(maxsize=256)
def _float_normaliser(task: Task, rows: int) -> Callable[[Signals, Mapping[str, float]], Any]:
    """Normalised margins of the first rows, from the signals of one state and its raw margins."""
    plan = plan_of(task)
    scales = tuple(map(_scale, plan.ranges))
    if not plan.compound:
        first = list(zip(plan.labels[:rows], scales, strict=False))

        def of_margins(signals: Signals, margins: Mapping[str, float]) -> list[float]:
            return [_normalised(margins[label], below, above) for label, (below, above) in first]

        return of_margins
    compiled, operations = compile_margins(task, plan.leaves, None), float_operations()

    def of_leaves(signals: Signals, margins: Mapping[str, float]) -> list[float]:
        leaves = [
            _normalised(float(margin), below, above)
            for margin, (below, above) in zip(compiled(signals), scales, strict=True)
        ]
        return _combined(plan, leaves, operations)[:rows]

    return of_leaves


def _normalised(margin: float, below: float, above: float) -> float:
    # Comparisons in this order keep NaN.
    if margin >= 0.0:
        return 1.0 if margin >= above else margin / above
    return -1.0 if margin <= -below else margin / below
