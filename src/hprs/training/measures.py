"""What a table of episodes shows: S, S+T, S+T+C, PAM and every requirement, with intervals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hprs.semantics.assessment import ACCOMPLISHED, SAFE, Assessment, accomplished_comfort
from hprs.spec.task import Task
from hprs.training.intervals import bootstrap_mean, wilson

SUMMARY = ("S", "S+T", "S+T+C", "PAM")


@dataclass(frozen=True)
class Measure:
    """A mean over episodes, with its 95 % confidence interval."""

    value: float
    low: float
    high: float


def values_by_measure(task: Task, assessments: Sequence[Assessment]) -> dict[str, list[float]]:
    """Name of a measure to its value in each episode; requirements as `kind label`."""
    pam = np.array([float(found.pam) for found in assessments])
    values = {
        "S": (pam >= SAFE).astype(float).tolist(),
        "S+T": (pam >= ACCOMPLISHED).astype(float).tolist(),
        "S+T+C": accomplished_comfort(pam).tolist(),
        "PAM": pam.tolist(),
    }
    for requirement in task.requirements:
        name = f"{requirement.kind} {requirement.label}"
        values[name] = [float(found.requirements[requirement.label]) for found in assessments]
    return values


def measures(
    task: Task, assessments: Sequence[Assessment], only: Sequence[str] = ()
) -> dict[str, Measure]:
    """Every measure of some episodes.

    Fractions of episodes get Wilson's interval, means of anything else a bootstrap's.

    Args:
        task: What they are assessed by.
        assessments: One an episode.
        only: Names of the measures that are wanted; empty for all.
    """
    found: dict[str, Measure] = {}
    for name, values in values_by_measure(task, assessments).items():
        if only and name not in only:
            continue
        counted = name in ("S", "S+T") or name.split()[0] in ("ensure", "achieve", "conquer")
        ends = wilson(round(sum(values)), len(values)) if counted else bootstrap_mean(values)
        found[name] = Measure(float(np.mean(values)), *ends)
    return found


def outside_ranges(assessments: Sequence[Assessment]) -> Mapping[str, int]:
    """Signal name to the number of states, over all episodes, in which it left its range."""
    total: Counter[str] = Counter()
    for found in assessments:
        total.update({name: int(count) for name, count in found.outside.items()})
    return dict(total)
