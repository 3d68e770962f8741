"""What a robustness test found: a row a point, as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from hprs.envs.driving.options import BACKWARDS, RANDOM
from hprs.experiments.perturbations import TRACK, Point
from hprs.semantics.assessment import Assessment
from hprs.spec.task import Task
from hprs.training.measures import Measure, measures

SHOWN = ("S", "S+T", "S+T+C")
"""Measures of a row."""
POOLED = "all generated"
"""The row that pools the generated tracks, which no policy of the test has seen."""


@dataclass(frozen=True)
class Row:
    """How a policy does at one point."""

    policy: str
    perturbation: str
    value: str
    unit: str
    trained: bool
    """Whether the policy was trained with it."""
    episodes: int
    measures: Mapping[str, Measure]
    """By name, those of `SHOWN`."""


def row_of(policy: str, point: Point, task: Task, found: Sequence[Assessment]) -> Row:
    """The row of a point.

    Args:
        policy: Its name.
        point: Where it was tested.
        task: What it is assessed by.
        found: Its episodes there.
    """
    return Row(
        policy=policy,
        perturbation=point.perturbation,
        value=point.value,
        unit=point.unit,
        trained=point.trained,
        episodes=len(found),
        measures=measures(task, found, SHOWN),
    )


def rows_of(
    policy: str, task: Task, found: Sequence[tuple[Point, Sequence[Assessment]]]
) -> list[Row]:
    """The rows of all points, and of the generated tracks together, for each way round."""
    rows = [row_of(policy, point, task, episodes) for point, episodes in found]
    for backwards in (False, True):
        generated = [
            (point, episodes)
            for point, episodes in found
            if point.perturbation == TRACK
            and point.value.startswith(RANDOM)
            and point.value.endswith(BACKWARDS) == backwards
        ]
        if generated:
            point = replace(generated[0][0], value=POOLED + BACKWARDS * backwards)
            pooled = [one for _, episodes in generated for one in episodes]
            rows.append(row_of(policy, point, task, pooled))
    return rows


def as_csv(rows: Sequence[Row]) -> str:
    """The rows as CSV; intervals are of 95 %."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    header = ["policy", "perturbation", "value", "unit", "trained", "episodes"]
    writer.writerow(header + [name + end for name in SHOWN for end in ("", " low", " high")])
    for row in rows:
        numbers = [row.measures[name] for name in SHOWN]
        writer.writerow(
            [
                row.policy,
                row.perturbation,
                row.value,
                row.unit,
                "yes" if row.trained else "no",
                row.episodes,
                *(f"{part:.4f}" for one in numbers for part in (one.value, one.low, one.high)),
            ]
        )
    return text.getvalue()
