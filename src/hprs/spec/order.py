"""The strict partial order of importance among a task's requirements.

Safety before target before comfort (the paper, section "A Task as a Partially-Ordered Set"), plus
the pairs that `prefer` adds; the order is their transitive closure.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from hprs.errors import SpecValidationError, did_you_mean
from hprs.spec.statements import Preference
from hprs.spec.task import Task
from hprs.spec.vocabulary import RequirementClass

_RANK: Mapping[RequirementClass, int] = {"safety": 0, "target": 1, "comfort": 2}


class Order(NamedTuple):
    """`above[label]` holds the labels of all strictly more important requirements."""

    above: Mapping[str, frozenset[str]]


def order_of(task: Task) -> Order:
    """The order of a task.

    Raises:
        SpecValidationError: A preference names an unknown label, contradicts the classes or closes
            a cycle.
    """
    rank = {r.label: _RANK[r.requirement_class] for r in task.requirements}
    higher_ranks = {
        own: {label for label in rank if rank[label] < own} for own in set(rank.values())
    }
    above = {label: set(higher_ranks[own]) for label, own in rank.items()}
    for preference in task.preferences:
        _check(preference, rank)
        higher, lower = preference.higher, preference.lower
        if lower == higher or lower in above[higher]:
            raise SpecValidationError(
                f"'prefer {higher} over {lower}' closes a cycle: "
                f"'{lower}' is already at least as important as '{higher}'.",
                preference.position,
            )
        gained = above[higher] | {higher}
        for label in rank:
            if label == lower or lower in above[label]:
                above[label] |= gained
    return Order({label: frozenset(labels) for label, labels in above.items()})


def _check(preference: Preference, rank: Mapping[str, int]) -> None:
    for label in (preference.higher, preference.lower):
        if label not in rank:
            raise SpecValidationError(
                f"'prefer' names the unknown requirement '{label}'.{did_you_mean(label, rank)}",
                preference.position,
            )
    if rank[preference.higher] > rank[preference.lower]:
        raise SpecValidationError(
            f"'prefer {preference.higher} over {preference.lower}' is against the classes: "
            "safety comes before target before comfort, always.",
            preference.position,
        )
