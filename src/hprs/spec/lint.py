"""Judges requirements by their bounds: what cannot be meant, and what is probably not meant."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from hprs.errors import SpecValidationError
from hprs.spec.expression import And, Comparison, Or, Predicate
from hprs.spec.inference import Inferred, infer
from hprs.spec.interval import Interval
from hprs.spec.task import Remark, Requirement, Task
from hprs.spec.traversal import comparisons, names


def _never(leaf: Interval, comparison: Comparison) -> bool:
    return leaf.high < 0.0 or (leaf.high == 0.0 and comparison.strict)


def _always(leaf: Interval, comparison: Comparison) -> bool:
    return leaf.low > 0.0 or (leaf.low == 0.0 and not comparison.strict)


def _verdict(
    predicate: Predicate,
    next_leaf: Callable[[], Interval],
    holds: Callable[[Interval, Comparison], bool],
    through_all: type[Predicate],
) -> bool:
    """Whether a verdict on comparisons carries to the predicate: all parts of one connective."""
    if isinstance(predicate, Comparison):
        return holds(next_leaf(), predicate)
    parts = [_verdict(part, next_leaf, holds, through_all) for part in predicate.parts]
    return all(parts) if isinstance(predicate, through_all) else any(parts)


def judge(
    requirement: Requirement,
    leaves: Sequence[Interval],
    bound: Interval,
    known: Mapping[str, Inferred],
) -> list[Remark]:
    """Remarks on a requirement from the ranges of its comparisons' margins and of its own.

    Raises:
        SpecValidationError: It can never be satisfied, or its score needs a bound it does not have.
    """
    label, predicate, where = requirement.label, requirement.predicate, requirement.position
    if _verdict(predicate, iter(leaves).__next__, _never, Or):
        raise SpecValidationError(
            f"requirement '{label}' can never be satisfied: its margin lies in {bound}."
            + _threshold(predicate, known),
            where,
        )
    remarks: list[Remark] = []
    if _verdict(predicate, iter(leaves).__next__, _always, And):
        remarks.append(
            Remark(
                f"requirement '{label}' is always satisfied (its margin lies in {bound}, its score "
                f"is 1); drop it or change its threshold.{_threshold(predicate, known)}",
                position=where,
            )
        )
    elif len(leaves) > 1:
        remarks += _judge_parts(requirement, leaves)
    if bound.high == 0.0:
        remarks.append(
            Remark(
                f"the margin of requirement '{label}' never exceeds 0, so its robustness cannot "
                "be positive; consider a tolerance.",
                position=where,
            )
        )
    if requirement.requirement_class != "safety":
        _check_finite(requirement, leaves)
    return remarks


def _judge_parts(requirement: Requirement, leaves: Sequence[Interval]) -> list[Remark]:
    remarks: list[Remark] = []
    for leaf, comparison in zip(leaves, comparisons(requirement.predicate), strict=True):
        for judge, verdict in ((_never, "never"), (_always, "always")):
            if judge(leaf, comparison):
                remarks.append(
                    Remark(
                        f"a comparison in requirement '{requirement.label}' is {verdict} "
                        f"satisfied: its margin lies in {leaf}.",
                        position=comparison.position or requirement.position,
                    )
                )
    return remarks


def _check_finite(requirement: Requirement, leaves: Sequence[Interval]) -> None:
    for leaf, comparison in zip(leaves, comparisons(requirement.predicate), strict=True):
        if math.isinf(leaf.low):
            raise SpecValidationError(
                f"requirement '{requirement.label}' needs a finite lower bound for its continuous "
                "score, but its margin has none. Give its signals finite ranges, use clip(), or "
                "name the expression with `let NAME = ... in [LOW, HIGH]`.",
                comparison.position or requirement.position,
            )


def _threshold(predicate: Predicate, known: Mapping[str, Inferred]) -> str:
    """Says which constant side of a single comparison lies outside the other side's range."""
    if not isinstance(predicate, Comparison):
        return ""
    left, right = infer(predicate.left, known), infer(predicate.right, known)
    if left.constant == right.constant:
        return ""
    threshold, other = (left.range, right.range) if left.constant else (right.range, left.range)
    if threshold.low in other:
        return ""
    return f" The threshold {threshold.low:g} is outside the range {other}."


def judge_whole(task: Task) -> list[Remark]:
    """Remarks on what a task has and lacks.

    Raises:
        SpecValidationError: It has two targets.
    """
    targets = [r for r in task.requirements if r.requirement_class == "target"]
    if len(targets) > 1:
        first, second = targets[0].label, targets[1].label
        raise SpecValidationError(
            f"a task has one target, but '{first}' and '{second}' are two. "
            "Join their conditions with `and`.",
            targets[1].position,
        )
    remarks: list[Remark] = []
    if not targets:
        remarks.append(
            Remark(
                "the task has no target (achieve or conquer): the base reward is always 0 and the "
                "target counts as met."
            )
        )
    used = frozenset[str]().union(
        *(names(r.predicate) for r in task.requirements),
        *(names(d.value) for d in task.definitions),
    )
    for signal in task.signals:
        if signal.name not in used:
            remarks.append(
                Remark(f"signal '{signal.name}' is never used.", position=signal.position)
            )
    return remarks
