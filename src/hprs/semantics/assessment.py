"""The policy assessment metric PAM, and S, S+T, S+T+C: how well episodes meet a task.

PAM is 1 for safety, plus 1/2 for the target, plus 1/4 times the average comfort (the paper, section
"Policy Assessment Metric"). Satisfaction looks at all states s_0 .. s_t; the comfort average at
s_1 .. s_t. A tally gathers the same numbers step by step with constant memory.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from numbers import Integral
from typing import Any, NamedTuple, TypeAlias, cast

import numpy as np

from hprs.errors import UsageError
from hprs.semantics.evaluation import Signals, evaluate_arrays
from hprs.semantics.plan import Evaluation, Plan, plan_of
from hprs.semantics.trace import Missing, check_missing, check_trace, count_outside, refuse_nan
from hprs.spec.misuse import shown
from hprs.spec.namespace import Array, both, namespace_of, select, truth
from hprs.spec.task import Task, require_task

SAFE, ACCOMPLISHED, COMFORT_SHARE = 1.0, 1.5, 0.25
"""PAM of a safe episode, of an accomplished one, and what full comfort adds."""


_Numbers: TypeAlias = "np.ndarray[Any, np.dtype[np.float64]]"


@dataclass(frozen=True)
class Assessment:
    """How well one episode meets a task; with a batch, every field is an array of its shape.

    None stands for what is not known, where a trace lacks signals; see `assess`.
    """

    pam: Any
    """Policy assessment metric F in [0, 1.75]."""
    safe: Any
    """Whether every safety requirement holds in every state."""
    target: Any
    """Whether the target is met (true where there is none)."""
    comfort: Any
    """Mean over the comfort requirements of the fraction of steps they hold in (1 without any)."""
    requirements: Mapping[str, Any]
    """Label to satisfied or not; for comfort requirements the fraction of steps."""
    length: Any
    """Number of steps t."""
    decided_at_start: Any
    """Whether s_0 was already unsafe or had already achieved the target."""
    outside: Mapping[str, Any]
    """Signal name to the number of states in which it left its range; only those that did."""

    @property
    def satisfied(self) -> Any:
        """Whether the task is satisfied: safe, and on target."""
        if self.safe is None or self.target is None:
            return False if self.safe is False or self.target is False else None
        return self.safe & self.target

    @property
    def unknown(self) -> tuple[str, ...]:
        """Labels of the requirements of which the trace does not say whether they are met."""
        return tuple([label for label, found in self.requirements.items() if found is None])


class Tally(NamedTuple):
    """What must be remembered of an episode to assess it; constant in its length."""

    safe: Any
    """Row a safety requirement: whether it held so far."""
    target: Any
    """Whether the target counts as met so far."""
    counts: Any
    """Row a comfort requirement: the number of states s_1 .. s_i it held in."""
    steps: Any
    """Number of steps i."""
    decided_at_start: Any
    """Whether s_0 decided the episode."""


def start(plan: Plan, satisfied: Any) -> Tally:
    """The tally at s_0.

    Args:
        plan: The task's plan.
        satisfied: Rows of `Evaluation.satisfied` in s_0, a list (one state) or an array (a batch).
    """
    safe = satisfied[: plan.safety_count]
    counts = satisfied[plan.comfort_start :]
    if _is_list(satisfied):
        target = True if plan.target_row is None else satisfied[plan.target_row]
        decided = not all(safe) or (plan.achieves and target)
        return Tally(safe, target, [0] * plan.comfort_count, 0, decided)
    xp = namespace_of((satisfied,))
    every = xp.ones_like(satisfied[0])
    target = every if plan.target_row is None else satisfied[plan.target_row]
    decided = ~_all(safe, every)
    if plan.achieves:
        decided = decided | target
    zeros = xp.astype(counts, xp.int32) * 0
    return Tally(safe, target, zeros, xp.astype(every, xp.int32) * 0, decided)


def advance(plan: Plan, tally: Tally, satisfied: Any) -> Tally:
    """The tally one step later; the same forms as `start`."""
    if _is_list(satisfied):
        return advance_many(plan, tally, [satisfied])
    target = tally.target
    if plan.target_row is not None:
        now = satisfied[plan.target_row]
        target = target | now if plan.achieves else now
    return Tally(
        tally.safe & satisfied[: plan.safety_count],
        target,
        tally.counts + satisfied[plan.comfort_start :],
        tally.steps + 1,
        tally.decided_at_start,
    )


def advance_many(plan: Plan, tally: Tally, states: Sequence[list[bool]]) -> Tally:
    """The tally after the steps of one state each whose `satisfied` are given; at least one."""
    columns = list(zip(*states, strict=True))
    safe, target = tally.safe, tally.target
    if plan.target_row is not None:
        now = columns[plan.target_row]
        target = (target or any(now)) if plan.achieves else now[-1]
    return Tally(
        [before and all(now) for before, now in zip(safe, columns[: len(safe)], strict=True)],
        target,
        list(map(operator.add, tally.counts, map(sum, columns[plan.comfort_start :]))),
        tally.steps + len(states),
        tally.decided_at_start,
    )


def violations(plan: Plan, evaluation: Evaluation) -> Any:
    """How many safety requirements a state violates, or each state of a batch."""
    safe = evaluation.satisfied[: plan.safety_count]
    if _is_list(safe):
        return float(safe.count(False))
    xp = namespace_of((safe,))
    return xp.sum(xp.astype(~safe, evaluation.potential.dtype), axis=0)


def is_safe(tally: Tally) -> Any:
    """Whether every safety requirement held so far."""
    if _is_list(tally.safe):
        return False not in tally.safe
    return _all(tally.safe, tally.target | True)


def achieved(plan: Plan, tally: Tally) -> Any:
    """Whether an `achieve` target is met, which ends an episode; false for any other target."""
    if plan.achieves:
        return tally.target
    return False if isinstance(tally.target, bool) else tally.target & False


def conclude(
    plan: Plan,
    tally: Tally,
    *,
    max_length: int | None = None,
    outside: Mapping[str, Any] | None = None,
) -> Assessment:
    """The assessment of an episode that a tally has followed.

    Args:
        plan: The task's plan.
        tally: The tally after the last step.
        max_length: Pad comfort with violations up to this many steps, as the paper's released code
            does; None averages over the episode's own steps, as the paper defines.
        outside: Signal name to the number of states outside its range.

    Raises:
        ValueError: The episode is longer than `max_length`; under `jax.jit` comfort is NaN then.
        UsageError: `max_length` is no whole number of at least 1.
    """
    steps = tally.steps
    divisor = steps if max_length is None else _padded(steps, max_length)
    fractions = [count / divisor for count in tally.counts]
    safe = is_safe(tally)
    comfort = (
        sum(fractions[1:], start=fractions[0]) / len(fractions) if fractions else safe * 0.0 + 1.0
    )
    pam = safe * 1.0 + tally.target * 0.5 + comfort * COMFORT_SHARE
    rows = [*tally.safe, *([] if plan.target_row is None else [tally.target]), *fractions]
    return Assessment(
        pam=pam,
        safe=safe,
        target=tally.target,
        comfort=comfort,
        requirements=plan.by_label(rows),
        length=steps,
        decided_at_start=tally.decided_at_start,
        outside=outside or {},
    )


def _padded(steps: Any, max_length: Any) -> Any:
    """`max_length`, if no episode is longer."""
    if isinstance(max_length, bool) or not isinstance(max_length, Integral) or max_length < 1:
        raise UsageError(
            f"max_length is a number of steps, at least 1, or None; got {shown(max_length)}."
        )
    too_long = steps > max_length
    found = too_long if isinstance(too_long, bool) else truth(too_long.any())
    if found is None:
        return select(too_long, math.nan, float(max_length))
    if not found:
        return max_length
    longest = int(np.asarray(steps).max())
    raise ValueError(f"an episode has {longest} steps, more than max_length={max_length}.")


def assess(
    task: Task, trace: Signals, *, max_length: int | None = None, missing: Missing = "error"
) -> Assessment:
    """Assess a whole trace, or a batch of traces of the same length.

    NumPy's arrays and lists are computed in float64, as by the wrappers; arrays of JAX and PyTorch
    in their own precision. Under `jax.jit` values are not looked at: NaN is not refused, and
    `outside` is empty.

    Args:
        task: The task.
        trace: Signal name to values, s_0 first; time on the first axis, batch axes after it.
        max_length: See `conclude`.
        missing: `"unknown"` assesses one trace that lacks signals, wholly or, where they or their
            margins are NaN, in some states. A requirement is measured where the other states and
            signals decide it, as one violation decides `ensure`, and None where they do not; so are
            `safe`, `target` and `comfort`. PAM is None unless every requirement is measured.

    Raises:
        TraceError: A signal is missing, NaN or no number, a margin is NaN, lengths differ, there is
            not one step, or the task reads no signal.
        UsageError: `missing` is unknown, or it is `"unknown"` and there is more than one trace.
        UsageError, ValueError: See `conclude`.
    """
    check_missing(missing)
    if missing == "unknown":
        # It builds on this module.
        from hprs.semantics.chunks import assess_chunks

        return assess_chunks(task, [trace], max_length=max_length, missing=missing)
    plan = plan_of(require_task(task))
    values = check_trace(plan, trace)
    xp = namespace_of(values.values())
    # NumPy's warnings would come before the error that says where.
    with np.errstate(all="ignore"):
        evaluation = evaluate_arrays(plan, values, xp)
    refuse_nan(plan, evaluation.margins)
    satisfied = evaluation.satisfied
    safe = xp.all(satisfied[: plan.safety_count], axis=1)
    counts = xp.sum(xp.astype(satisfied[plan.comfort_start :, 1:], xp.int32), axis=1)
    first = start(plan, satisfied[:, 0])
    target = first.target
    if plan.target_row is not None:
        row = satisfied[plan.target_row]
        target = xp.any(row, axis=0) if plan.achieves else row[-1]
    steps = first.steps + (satisfied.shape[1] - 1)
    tally = Tally(safe, target, counts, steps, first.decided_at_start)
    outside = count_outside(task, values)
    return _plain(conclude(plan, tally, max_length=max_length, outside=outside))


@dataclass(frozen=True)
class Summary:
    """Several episodes' assessments brought to the paper's three columns, and PAM."""

    safe: float
    """S: fraction of episodes that are safe (PAM >= 1)."""
    safe_target: float
    """S+T: fraction that is safe and on target (PAM >= 1.5)."""
    safe_target_comfort: float
    """S+T+C: mean of [PAM >= 1.5] * (PAM - 1.5) / 0.25."""
    pam: float
    """Mean PAM."""
    requirements: Mapping[str, float]
    """Label to the mean over episodes."""
    episodes: int
    """How many episodes."""


def summarise(assessments: Assessment | Iterable[Assessment]) -> Summary:
    """Summarise episodes of one task.

    Args:
        assessments: Their assessments; each episode of a batch counts as one.

    Raises:
        UsageError: There are none, or they are of tasks with different requirements.
    """
    found = _listed(assessments)
    if not found:
        raise UsageError("there is no episode to summarise.")
    labels = found[0].requirements.keys()
    if any(other.requirements.keys() != labels for other in found):
        raise UsageError("these episodes are of tasks with different requirements.")
    for number, one in enumerate(found):
        if one.unknown:
            raise UsageError(
                f"episode {number} cannot be summarised: its trace does not say whether "
                f"{', '.join(one.unknown)} is met."
            )
    pam = _episodes(a.pam for a in found)
    comfort: _Numbers = accomplished_comfort(pam)
    return Summary(
        safe=float(np.mean(pam >= SAFE)),
        safe_target=float(np.mean(pam >= ACCOMPLISHED)),
        safe_target_comfort=float(np.mean(comfort)),
        pam=float(np.mean(pam)),
        requirements={
            label: float(np.mean(_episodes(a.requirements[label] for a in found)))
            for label in labels
        },
        episodes=len(pam),
    )


def _listed(given: object) -> list[Assessment]:
    found = [given]
    if isinstance(given, Iterable) and not isinstance(given, str):
        found = list(cast("Iterable[object]", given))
    for one in found:
        if not isinstance(one, Assessment):
            raise UsageError(f"assessments are summarised, as of hprs.assess; got {shown(one)}.")
    return cast("list[Assessment]", found)


def _episodes(values: Iterable[Any]) -> _Numbers:
    """One number an episode, from those of single episodes and of batches."""
    return np.concatenate([np.atleast_1d(np.asarray(value, float)).ravel() for value in values])


def accomplished_comfort(pam: Array) -> Array:
    """Comfort of accomplished episodes, 0 for all others: [PAM >= 1.5] * (PAM - 1.5) / 0.25."""
    return select(pam >= ACCOMPLISHED, (pam - ACCOMPLISHED) / COMFORT_SHARE, pam * 0.0)


def _is_list(rows: Any) -> bool:
    """Whether rows are those of one state of floats."""
    return isinstance(rows, list)


def _all(rows: Any, every: Any) -> Any:
    return reduce(both, rows, every)


def _plain(assessment: Assessment) -> Assessment:
    """Scalars instead of arrays of no dimension."""

    def scalar(value: Any) -> Any:
        try:
            return value.item() if getattr(value, "ndim", None) == 0 else value
        except TypeError:  # under jax.jit
            return value

    def scalars(values: Mapping[str, Any]) -> dict[str, Any]:
        return {name: scalar(value) for name, value in values.items()}

    return Assessment(
        pam=scalar(assessment.pam),
        safe=scalar(assessment.safe),
        target=scalar(assessment.target),
        comfort=scalar(assessment.comfort),
        requirements=scalars(assessment.requirements),
        length=scalar(assessment.length),
        decided_at_start=scalar(assessment.decided_at_start),
        outside=scalars(assessment.outside),
    )
