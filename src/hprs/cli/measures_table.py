"""The table of measures that `hprs evaluate`, `hprs assess` and the demo print."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hprs.cli.console import decimals, interval, plural, print_table
from hprs.semantics.assessment import Assessment
from hprs.spec.task import Task
from hprs.training.measures import SUMMARY, Measure, outside_ranges


def print_measures(
    title: str,
    task: Task,
    found: Mapping[str, Measure],
    *,
    floors: Mapping[str, Mapping[str, float]],
    worst: Mapping[str, tuple[float, str]] | None = None,
) -> None:
    """Print measures with their intervals.

    Args:
        title: A line above the table.
        task: The task.
        found: Name to measure, as `hprs.training.measures` gives them.
        floors: Name of a floor to the values of its measures.
        worst: Name of a measure to its lowest value over the seeds, and that seed.
    """
    header = ["", "mean", "95 % interval", *(["worst seed"] if worst else []), *floors]
    rows = [
        [
            name,
            decimals(measure.value),
            interval(measure.low, measure.high),
            *([f"{decimals(worst[name][0])} ({worst[name][1]})"] if worst else []),
            *(decimals(values[name]) for values in floors.values()),
        ]
        for name, measure in found.items()
    ]
    print_table(header, rows, title=title, breaks=(len(SUMMARY) - 1,))


def print_notes(assessments: Sequence[Assessment], *, several: bool) -> None:
    """Say what the intervals are, and what was unusual."""
    print()
    print("S safe, S+T safe and on target, S+T+C mean comfort of those (0 for the others).")
    print(
        "Intervals are over episodes: Wilson's for fractions of episodes, bootstrap for means."
        + (" The spread between seeds is not in them." if several else "")
    )
    states = sum(int(assessment.length) + 1 for assessment in assessments)
    for name, count in outside_ranges(assessments).items():
        print(f"Signal '{name}' left its range in {count:,} of {plural(states, 'state')}.")
    decided = sum(bool(assessment.decided_at_start) for assessment in assessments)
    if decided:
        print(f"{plural(decided, 'episode')} decided by the first state already.")
