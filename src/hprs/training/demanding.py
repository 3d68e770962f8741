"""Remarks on a task that asks too little: a policy that meets it proves little."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from hprs.semantics.assessment import Assessment
from hprs.spec.task import Task
from hprs.training.measures import values_by_measure
from hprs.wrappers.single import TaskWrapper

OFTEN = 0.5
"""A floor that meets the task in this fraction of its episodes meets it too often."""
ALWAYS = 0.999
"""A wish that every floor meets in this fraction of its steps asks nothing of a policy."""


def held_at_every_reset(make: Callable[[], TaskWrapper], seeds: Sequence[int]) -> tuple[str, ...]:
    """Labels of the target and the comfort requirements that hold in the first state of episodes.

    Args:
        make: Makes an environment with its task.
        seeds: Seeds of the resets.
    """
    environment = make()
    labels = [r.label for r in environment.task.requirements if r.requirement_class != "safety"]
    try:
        for seed in seeds:
            _, info = environment.reset(seed=seed)
            # A margin of 0 may hold or not; it is no evidence.
            labels = [label for label in labels if info["margins"][label] > 0.0]
            if not labels:
                break
    finally:
        environment.close()
    return tuple(labels)


def remarks(
    task: Task, at_reset: Sequence[str], floors: Mapping[str, Sequence[Assessment]]
) -> list[str]:
    """What shows that a task asks too little, a sentence each.

    Args:
        task: The task.
        at_reset: What `held_at_every_reset` found.
        floors: Name of a policy that knows nothing to the assessments of its episodes.
    """
    found: list[str] = []
    target = task.target
    if target is not None and target.label in at_reset:
        found.append(
            f"'{target.label}', the target, holds at every reset: there is nothing to reach."
        )
    each = {name: values_by_measure(task, assessments) for name, assessments in floors.items()}
    for name, values in each.items():
        met = sum(values["S+T"]) / len(values["S+T"])
        if target is not None and met >= OFTEN:
            found.append(f"{name} meets the task in {met:.0%} of its episodes.")
    for requirement in task.requirements:
        key = f"{requirement.kind} {requirement.label}"
        free = requirement.requirement_class == "comfort" and requirement.label in at_reset
        if free and each and all(min(values[key]) >= ALWAYS for values in each.values()):
            found.append(
                f"'{requirement.label}' holds from the reset on whatever is done: it asks nothing."
            )
    return found
