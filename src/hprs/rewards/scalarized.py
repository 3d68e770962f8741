"""MORL: each requirement shapes by itself, and weights add them up (Brys et al., 2014)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence, Set
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from operator import mul
from types import MappingProxyType
from typing import TypeAlias, cast

from hprs.errors import UsageError, did_you_mean
from hprs.rewards.shaping import DEFAULT_END, End, PotentialBased, check_convention
from hprs.semantics.evaluation import is_single
from hprs.semantics.plan import Evaluation, plan_of
from hprs.spec.misuse import shown
from hprs.spec.namespace import Array
from hprs.spec.task import Task, require_task
from hprs.spec.vocabulary import RequirementClass

Weights: TypeAlias = Sequence[float] | Mapping[str, float]
"""One a requirement: in the order of the task's text, or by label."""

DECREASING: Mapping[RequirementClass, float] = MappingProxyType(
    {"safety": 1.0, "target": 0.5, "comfort": 0.25}
)
"""The released code's weights by class, before they are divided by their sum."""


@dataclass(frozen=True)
class Scalarized(PotentialBased):
    """Base reward plus the weighted sum of each requirement's own potential difference.

    A requirement's own potential is its score; no requirement matters more than another but by its
    weight. Weights are taken as they are.

    Args:
        task: The task.
        weights: One a requirement, in the order of the text, or by label; not negative.
        end: The convention at the end of an episode; see `hprs.rewards.shaping`.
        discount: The learner's discount in (0, 1]; `"invariant"` needs it, the others ignore it.

    Raises:
        UsageError: A weight is missing, superfluous, negative or no finite number; the convention
            is unknown, or its discount missing or outside (0, 1].
    """

    task: Task
    weights: Weights
    end: End = DEFAULT_END
    discount: float | None = None

    def __post_init__(self) -> None:
        """Check the convention and the weights, and keep these in the order of the text."""
        check_convention(self.end, self.discount)
        object.__setattr__(self, "weights", _checked(require_task(self.task), self.weights))

    @cached_property
    def _by_row(self) -> tuple[float, ...]:
        """The weights in the order of the plan's rows."""
        weights = dict(zip(self.task.labels, cast("tuple[float, ...]", self.weights), strict=True))
        return tuple([weights[label] for label in plan_of(self.task).labels])

    def _potential(self, evaluation: Evaluation) -> Array:
        if is_single(evaluation):
            return sum(map(mul, self._by_row, evaluation.scores.values()), 0.0)
        total: Array = evaluation.potential * 0.0
        for row, weight in enumerate(self._by_row):
            total = total + weight * evaluation.scores[row]
        return total


def uniform_weights(task: Task) -> tuple[float, ...]:
    """The same for every requirement, and 1 in total."""
    return (1.0 / len(task.requirements),) * len(task.requirements) if task.requirements else ()


def decreasing_weights(task: Task) -> tuple[float, ...]:
    """In the proportions of `DECREASING`, and 1 in total."""
    raw = [DECREASING[requirement.requirement_class] for requirement in task.requirements]
    return tuple(weight / sum(raw) for weight in raw)


def _checked(task: Task, weights: object) -> tuple[float, ...]:
    """The weights in the order of the text."""
    labels = task.labels
    if isinstance(weights, Mapping):
        given = cast("Mapping[str, object]", weights)
        for label in given:
            if label not in labels:
                raise UsageError(
                    f"a weight is given for '{label}', which is no requirement; the task has "
                    f"{', '.join(labels)}.{did_you_mean(str(label), labels)}"
                )
        missing = [label for label in labels if label not in given]
        if missing:
            raise UsageError(f"no weight is given for {', '.join(missing)}.")
        weights = [given[label] for label in labels]
    listed = _listed(labels, weights)
    if len(listed) != len(labels):
        raise UsageError(
            f"the task has {len(labels)} requirements ({', '.join(labels)}), got {len(listed)} "
            "weights."
        )
    return tuple([_weight(label, weight) for label, weight in zip(labels, listed, strict=True)])


def _listed(labels: Sequence[str], weights: object) -> list[object]:
    """The weights as a list."""
    found = shown(weights)
    advice = " A set has no order." if isinstance(weights, Set) else ""
    if not advice and not isinstance(weights, str | bytes):
        # An array without axes has `__iter__`, too, and only iterating tells.
        with suppress(TypeError):
            return list(cast("Sequence[object]", weights))
    raise UsageError(
        f"weights are a list, one a requirement ({', '.join(labels)}), or a mapping from labels, "
        f"got {found}.{advice}"
    )


def _weight(label: str, weight: object) -> float:
    try:
        number = math.nan if isinstance(weight, bool | str) else float(cast(float, weight))
    except (TypeError, ValueError):
        number = math.nan
    if not 0.0 <= number < math.inf:
        raise UsageError(
            f"the weight of '{label}' must be a finite number that is not negative, "
            f"got {shown(weight)}."
        )
    return number
