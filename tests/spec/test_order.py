from __future__ import annotations

import itertools

import pytest
from hypothesis import given

from hprs.errors import SpecValidationError
from hprs.spec.expression import Name
from hprs.spec.order import order_of
from hprs.spec.task import Preference, Requirement, Signal, Task
from hprs.spec.vocabulary import Kind
from tests.strategies import tasks

KINDS: tuple[Kind, ...] = ("ensure", "ensure", "achieve", "encourage", "encourage")
LABELS = "abcde"


def task(*preferences: tuple[str, str]) -> Task:
    return Task(
        [Signal("x", 0, 1)],
        [
            Requirement(kind, label, Name("x") <= 0.5)
            for kind, label in zip(KINDS, LABELS, strict=True)
        ],
        preferences=[Preference(*pair) for pair in preferences],
    )


def above(*preferences: tuple[str, str]) -> dict[str, str]:
    order = task(*preferences).order
    return {label: "".join(sorted(labels)) for label, labels in order.above.items()}


def test_safety_comes_before_target_before_comfort() -> None:
    assert above() == {"a": "", "b": "", "c": "ab", "d": "abc", "e": "abc"}


def test_a_preference_adds_a_pair() -> None:
    assert above(("d", "e")) == {"a": "", "b": "", "c": "ab", "d": "abc", "e": "abcd"}
    assert above(("b", "a"))["a"] == "b"


def test_a_preference_that_the_classes_imply_changes_nothing() -> None:
    assert above(("a", "e")) == above()


@given(tasks(max_requirements=8))
def test_the_order_is_strict_and_transitive(task: Task) -> None:
    above = task.order.above
    for label in task.labels:
        assert label not in above[label]
        for higher in above[label]:
            assert above[higher] <= above[label]


@given(tasks(max_requirements=8))
def test_the_order_is_the_smallest_that_holds_classes_and_preferences(task: Task) -> None:
    rank = {"safety": 0, "target": 1, "comfort": 2}
    of = {r.label: rank[r.requirement_class] for r in task.requirements}
    pairs = {(a, b) for a in of for b in of if of[a] < of[b]}
    pairs |= {(p.higher, p.lower) for p in task.preferences}
    for middle, first, last in itertools.product(of, of, of):
        if (first, middle) in pairs and (middle, last) in pairs:
            pairs.add((first, last))
    assert {(a, b) for b, labels in task.order.above.items() for a in labels} == pairs


@pytest.mark.parametrize(
    ("preferences", "message"),
    [
        ([("a", "a")], "'prefer a over a' closes a cycle"),
        ([("a", "b"), ("b", "a")], "'prefer b over a' closes a cycle"),
        ([("e", "a")], "against the classes"),
        ([("c", "a")], "against the classes"),
        ([("a", "z")], "unknown requirement 'z'"),
        ([("x", "a")], "unknown requirement 'x'"),
    ],
)
def test_contradictions_are_refused(preferences: list[tuple[str, str]], message: str) -> None:
    with pytest.raises(SpecValidationError, match=message):
        task(*preferences)


def test_a_long_cycle_is_found() -> None:
    requirements = [Requirement("ensure", f"r{i}", Name("x") <= 0.5) for i in range(20)]
    ring = [Preference(f"r{i}", f"r{(i + 1) % 20}") for i in range(20)]
    line = Task([Signal("x", 0, 1)], requirements, preferences=ring[:-1])
    assert len(order_of(line).above["r19"]) == 19
    with pytest.raises(SpecValidationError, match="'prefer r19 over r0' closes a cycle"):
        Task([Signal("x", 0, 1)], requirements, preferences=ring)
