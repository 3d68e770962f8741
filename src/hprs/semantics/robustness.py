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
from types import MappingProxyType, ModuleType
from typing import Literal, NamedTuple, TypeAlias, get_args

from hprs.errors import UsageError, did_you_mean
from hprs.semantics.evaluation import Signals, column, evaluate, is_single, leaf_margins, pick
from hprs.semantics.plan import Evaluation, Plan, plan_of
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


class Follower:
    """Follows parts of a task through an episode; plain data, so that it can be pickled.

    Args:
        task: The task.
        parts: What to follow.
        form: One of `MARGIN_FORMS`; or "truth", which is 1 for a row that is satisfied, strictness
            included, and 0 for one that is not.
    """

    def __init__(
        self, task: Task, parts: Sequence[Part], form: MarginForm | Literal["truth"]
    ) -> None:
        plan = plan_of(task)
        self._task, self._form = task, form
        self._parts = tuple(parts)
        self._operators = [part.operator for part in parts]
        self._rows = [part.rows for part in parts]
        self._last = max(row for part in parts for row in part.rows) + 1
        self._leafwise = form == "normalised" and plan.compound
        self._scaled_rows = [
            [(plan.labels[row], *_scale(leaf)) for row, leaf in zip(part.rows, leaves, strict=True)]
            for part, leaves in zip(parts, _leaves(plan, self._parts), strict=True)
        ]

    def now(self, signals: Signals) -> list[Array]:
        """For each part the least value of its rows in this state, or in each of a batch."""
        evaluation = evaluate(self._task, signals)
        if not is_single(evaluation):
            return self._of_batch(signals, evaluation)
        if self._form == "truth":
            satisfied = evaluation.satisfied
            return [float(all([satisfied[row] for row in rows])) for rows in self._rows]
        if self._leafwise:
            values = _float_normaliser(self._task)(signals)
            return [_smallest([values[row] for row in rows]) for rows in self._rows]
        margins = evaluation.margins
        if self._form == "raw":
            return [_smallest([margins[row[0]] for row in rows]) for rows in self._scaled_rows]
        return [
            _smallest([_normalised(margins[label], below, above) for label, below, above in rows])
            for rows in self._scaled_rows
        ]

    def begin(self, signals: Signals) -> tuple[Array, ...]:
        """The robustness of every part over s_0 alone."""
        return tuple(self.now(signals))

    def advance(self, running: tuple[Array, ...], signals: Signals) -> tuple[Array, ...]:
        """The robustness of every part over the episode so far, one state later."""
        now = self.now(signals)
        operations = _operations(now)
        for index, operator in enumerate(self._operators):
            if operator == "always":
                now[index] = operations["min"](running[index], now[index])
            elif operator == "eventually":
                now[index] = operations["max"](running[index], now[index])
        return tuple(now)

    def _of_batch(self, signals: Signals, evaluation: Evaluation) -> list[Array]:
        plan = plan_of(self._task)
        xp = namespace_of((evaluation.margins,))
        least = array_operations(xp)["min"]
        values = evaluation.margins[: self._last]
        if self._form == "truth":
            values = xp.astype(evaluation.satisfied[: self._last], evaluation.potential.dtype)
        elif self._leafwise:
            leaves = leaf_margins(plan, pick(plan, signals), xp)
            values = _combined(plan, _scaled(plan, leaves), array_operations(xp))
        elif self._form == "normalised":
            values = _scaled(plan, values)
        return [least(*[values[row] for row in rows]) for rows in self._rows]


def least_of(values: Sequence[Array]) -> Array:
    """The smallest of some floats, or of some arrays one by one."""
    return _operations(values)["min"](*values)


@lru_cache(maxsize=256)
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
    parts = [Part(OPERATORS[row.kind], (number,)) for number, row in enumerate(plan.rows)]
    over_time = Follower(task, parts, margins).now(values) if parts else []
    return plan.by_label(
        [_over_time(part.operator, row, xp) for part, row in zip(parts, over_time, strict=True)]
    )


def _over_time(operator: Operator, values: Array, xp: ModuleType) -> Array:
    if operator == "eventually always":
        return values[-1]
    return (xp.min if operator == "always" else xp.max)(values, axis=0)


def _scale(leaf: Interval) -> tuple[float, float]:
    """Distances from 0 to the bounds of a margin; one that lies at or beyond 0 is the other's."""
    below, above = -leaf.low, leaf.high
    return (
        below if below > 0.0 else above if above > 0.0 else 1.0,
        above if above > 0.0 else below if below > 0.0 else 1.0,
    )


def _leaves(plan: Plan, parts: Sequence[Part]) -> list[list[Interval]]:
    """For each part the ranges of its rows, where each row is one comparison; else of any."""
    if plan.compound:
        return [[plan.ranges[0]] * len(part.rows) for part in parts]
    return [[plan.ranges[row] for row in part.rows] for part in parts]


def _scaled(plan: Plan, leaves: Array) -> Array:
    """Margins of the first leaves, normalised."""
    xp = namespace_of((leaves,))
    below, above = zip(*map(_scale, plan.ranges[: leaves.shape[0]]), strict=True)
    scale = xp.where(leaves >= 0.0, column(above, leaves, xp), column(below, leaves, xp))
    return xp.clip(leaves / scale, -1.0, 1.0)


def _combined(plan: Plan, leaves: Sequence[Array], operations: Operations) -> list[Array]:
    least, most = operations["min"], operations["max"]
    return plan.combine(leaves, lambda parts: least(*parts), lambda parts: most(*parts))


@lru_cache(maxsize=256)
def _float_normaliser(task: Task) -> Callable[[Signals], list[float]]:
    """Normalised margins of all rows from the signals of one state, comparison by comparison."""
    plan = plan_of(task)
    scales = tuple(map(_scale, plan.ranges))
    compiled, operations = compile_margins(task, plan.leaves, None), float_operations()

    def normalise(signals: Signals) -> list[float]:
        leaves = [
            _normalised(float(margin), below, above)
            for margin, (below, above) in zip(compiled(signals), scales, strict=True)
        ]
        return _combined(plan, leaves, operations)

    return normalise


def _operations(values: Sequence[Array]) -> Operations:
    if isinstance(values[0], float):
        return float_operations()
    return array_operations(namespace_of(values))


def _smallest(values: list[float]) -> float:
    if len(values) == 1:
        return values[0]
    return float_operations()["min"](*values)


def _normalised(margin: float, below: float, above: float) -> float:
    # Comparisons in this order keep NaN.
    if margin >= 0.0:
        return 1.0 if margin >= above else margin / above
    return -1.0 if margin <= -below else margin / below
