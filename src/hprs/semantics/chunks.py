"""Assesses a trace chunk by chunk, in constant memory, also where it lacks signals.

A signal that is missing makes comparisons that may hold or not. Two tallies follow the trace, one
of what surely holds, one of what may hold. Where both end with the same answer, it is known.
"""

from __future__ import annotations

import operator
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from functools import partial, reduce
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from hprs.errors import TraceError, UsageError
from hprs.semantics.assessment import Assessment, Tally, conclude, start
from hprs.semantics.evaluation import Signals, leaf_margins, leaf_satisfied
from hprs.semantics.plan import Plan, plan_of
from hprs.semantics.trace import (
    TOO_SHORT,
    Missing,
    check_missing,
    check_trace,
    count_outside,
    refuse_nan,
)
from hprs.spec.namespace import Array, both, either, namespace_of
from hprs.spec.task import Task, require_task

Combine: TypeAlias = Callable[[Array, Array], Array]


def assess_chunks(
    task: Task,
    chunks: Iterable[Signals],
    *,
    max_length: int | None = None,
    missing: Missing = "error",
) -> Assessment:
    """Assess one trace that comes in pieces, as `hprs.assess` assesses the whole.

    Args:
        task: The task.
        chunks: Consecutive pieces, each as a trace of `hprs.assess`; the first begins with s_0.
            Pieces of one state are allowed, empty ones are passed over.
        max_length: See `hprs.assess`.
        missing: See `hprs.assess`.

    Raises:
        TraceError, UsageError, ValueError: See `hprs.assess`.
    """
    check_missing(missing)
    plan = plan_of(require_task(task))
    known: _Known | None = None
    outside: Counter[str] = Counter()
    states = 0
    for chunk in chunks:
        values = check_trace(plan, chunk, missing=missing, first=states, least=0)
        size = next(iter(values.values())).shape[0]
        if not size:
            continue
        if len(values) < len(plan.signals):
            values = _completed(plan, values)
        sure, possible = _bounds(plan, values, missing, first=states)
        states += size
        known = _advance(plan, known, sure, possible)
        outside.update(count_outside(task, values))
    if known is None or states < 2:
        raise TraceError(TOO_SHORT)
    counts = {name: int(count) for name, count in outside.items()}
    return _conclude(plan, known, max_length, counts)


class _Known(NamedTuple):
    """What is known of a trace so far."""

    sure: Tally
    """Of what surely holds."""
    possible: Tally
    """Of what may hold."""
    decided_at_start: bool | None


def _completed(plan: Plan, values: Mapping[str, Array]) -> dict[str, Array]:
    """The signals, and NaN for those that are missing."""
    xp = namespace_of(values.values())
    lengths = {signal.name: signal.length for signal in plan.task.signals}
    name = next(iter(values))
    like = values[name] * 1.0
    nothing = like * float("nan") if lengths[name] is None else like[..., 0] * float("nan")
    found: dict[str, Array] = {}
    for name in plan.signals:
        length = lengths[name]
        value = nothing if length is None else xp.stack([nothing] * length, axis=-1)
        found[name] = values.get(name, value)
    return found


def _bounds(
    plan: Plan, values: Mapping[str, Array], missing: Missing, *, first: int
) -> tuple[Array, Array]:
    """Rows of what surely holds and of what may hold, over the time of one piece."""
    xp = namespace_of(values.values())
    with np.errstate(all="ignore"):
        leaves = leaf_margins(plan, values, xp)
    if leaves.ndim != 2:
        raise UsageError(
            "a trace in pieces, or one that lacks signals, is assessed alone; its signals have "
            "time as their only axis (and vectors one more)."
        )
    holds = leaf_satisfied(plan, leaves, xp)
    sure = _rows(plan, holds, both, either)
    unknown = xp.isnan(leaves)
    if not xp.any(unknown):
        return sure, sure
    if missing == "error":
        refuse_nan(plan, _rows(plan, leaves, xp.minimum, xp.maximum), first=first)
    return sure, _rows(plan, holds | unknown, both, either)


def _rows(plan: Plan, leaves: Array, least: Combine, most: Combine) -> Array:
    """One row a requirement from one a comparison."""
    if not plan.compound:
        return leaves
    xp = namespace_of((leaves,))
    return xp.stack(plan.combine(list(leaves), partial(reduce, least), partial(reduce, most)))


def _advance(plan: Plan, known: _Known | None, sure: Array, possible: Array) -> _Known:
    decided = known.decided_at_start if known else _decided_at_start(plan, sure, possible)
    lower = _tally(plan, known.sure if known else None, sure)
    # Most pieces lack nothing.
    same = possible is sure and (known is None or known.possible is known.sure)
    upper = lower if same else _tally(plan, known.possible if known else None, possible)
    return _Known(lower, upper, decided)


def _tally(plan: Plan, tally: Tally | None, satisfied: Array) -> Tally:
    """The tally after one piece."""
    if tally is None:
        tally, satisfied = start(plan, _plain(satisfied[:, 0])), satisfied[:, 1:]
    if not satisfied.shape[1]:
        return tally
    xp = namespace_of((satisfied,))
    target = tally.target
    if plan.target_row is not None:
        row = satisfied[plan.target_row]
        target = (target or bool(xp.any(row))) if plan.achieves else bool(row[-1])
    held = _plain(xp.all(satisfied[: plan.safety_count], axis=1))
    comfort = xp.astype(satisfied[plan.comfort_start :], xp.int32)
    counts = [int(count) for count in xp.sum(comfort, axis=1)]
    return Tally(
        [before and now for before, now in zip(tally.safe, held, strict=True)],
        target,
        list(map(operator.add, tally.counts, counts)),
        tally.steps + satisfied.shape[1],
        tally.decided_at_start,
    )


def _decided_at_start(plan: Plan, sure: Array, possible: Array) -> bool | None:
    """Whether s_0 decided the episode; None where it may have."""
    surely, perhaps = start(plan, _plain(sure[:, 0])), start(plan, _plain(possible[:, 0]))
    if not all(perhaps.safe) or (plan.achieves and surely.target):
        return True
    return None if not all(surely.safe) or (plan.achieves and perhaps.target) else False


def _plain(values: Array) -> list[bool]:
    return [bool(value) for value in values]


def _conclude(
    plan: Plan, known: _Known, max_length: int | None, outside: Mapping[str, Any]
) -> Assessment:
    least, most = [
        conclude(plan, tally, max_length=max_length) for tally in (known.sure, known.possible)
    ]
    requirements = {
        label: _if_equal(found, most.requirements[label])
        for label, found in least.requirements.items()
    }
    measured = None not in requirements.values()
    return Assessment(
        pam=least.pam if measured else None,
        safe=_if_equal(least.safe, most.safe),
        target=_if_equal(least.target, most.target),
        comfort=_if_equal(least.comfort, most.comfort),
        requirements=requirements,
        length=least.length,
        decided_at_start=known.decided_at_start,
        outside=outside,
    )


def _if_equal(least: Any, most: Any) -> Any:
    return least if least == most else None
