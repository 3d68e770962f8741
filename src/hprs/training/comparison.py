"""Compares two policies on the same episodes: paired differences, with intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hprs.semantics.assessment import Assessment
from hprs.spec.task import Task
from hprs.training.intervals import bootstrap_mean
from hprs.training.measures import Measure, values_by_measure


@dataclass(frozen=True)
class Difference:
    """A measure of both, and how much higher the second one's is."""

    one: float
    """Mean over episodes."""
    other: float
    """Mean over episodes."""
    difference: Measure
    """The second minus the first, episode by episode, with a bootstrap interval over episodes."""


@dataclass(frozen=True)
class Comparison:
    """What two policies made of the same episodes."""

    differences: Mapping[str, Difference]
    """Name of a measure, as `values_by_measure` has them, to its difference."""
    better: int
    """Episodes in which the first one's PAM is higher."""
    worse: int
    """Episodes in which the second one's PAM is higher."""
    episodes: int
    """How many both played."""

    @property
    def probability(self) -> float:
        """How likely the first one is the better in an episode, where a tie counts half."""
        return 0.5 + 0.5 * (self.better - self.worse) / self.episodes


def compare(
    task: Task, one: Sequence[Sequence[Assessment]], other: Sequence[Sequence[Assessment]]
) -> Comparison:
    """Compare two policies, or two groups of them.

    Args:
        task: What they are assessed by.
        one: Assessments of the first, for each of its seeds those of the same episodes in the same
            order. An episode counts with its mean over the seeds.
        other: Those of the second.

    Raises:
        ValueError: They did not play as many episodes.
    """
    if len({len(episodes) for episodes in (*one, *other)}) != 1:
        raise ValueError("Both must have played the same episodes.")
    first, second = _means(task, one), _means(task, other)
    differences = {name: _difference(values, second[name]) for name, values in first.items()}
    gap = first["PAM"] - second["PAM"]
    return Comparison(differences, int((gap > 0).sum()), int((gap < 0).sum()), len(gap))


def _means(task: Task, group: Sequence[Sequence[Assessment]]) -> dict[str, np.ndarray]:
    each = [values_by_measure(task, episodes) for episodes in group]
    return {name: np.mean([values[name] for values in each], axis=0) for name in each[0]}


def _difference(one: np.ndarray, other: np.ndarray) -> Difference:
    gap = other - one
    low, high = bootstrap_mean(gap.tolist())
    return Difference(float(one.mean()), float(other.mean()), Measure(float(gap.mean()), low, high))
