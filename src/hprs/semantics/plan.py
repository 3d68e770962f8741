"""What evaluating a task needs, derived once: requirements as rows, in the order of their classes.

All arrays of the semantics have the requirements on their first axis: safety rows first, then the
target, then comfort; inside a class the order of the text. The batch axes follow.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import ModuleType
from typing import Any, NamedTuple, TypeVar

from hprs.spec.compiler import Margins, compile_margins, used_signals
from hprs.spec.expression import And, Comparison, Predicate
from hprs.spec.interval import Interval
from hprs.spec.task import Requirement, Task, require_task
from hprs.spec.traversal import comparisons

T = TypeVar("T")


class Evaluation(NamedTuple):
    """What a task says of a state, or of a batch of states.

    The first three have one row a requirement on their first axis, in the order of `Plan.rows`. For
    a single state of floats margins and scores are dictionaries by label in the same order, which
    is how they are reported, and `satisfied` is a list.
    """

    margins: Any
    """Signed distance to the threshold; min and max through `and` and `or` (robustness)."""
    satisfied: Any
    """Whether the predicate holds; strictness counts at a margin of exactly 0."""
    scores: Any
    """Score r in [0, 1]: binary for safety, continuous otherwise (the paper, "Hierarchical
    Potential-based Reward Shaping")."""
    potential: Any
    """Hierarchical potential Psi (the paper, equation `hrs_pot`), from 0 to the number of rows."""


@dataclass(frozen=True)
class Group:
    """Rows that share one weight: the product of the scores of the rows `above` them."""

    above: tuple[int, ...]
    members: tuple[int, ...]


class Plan:
    """The rows of a task and everything constant about them.

    Args:
        task: The task to evaluate.
    """

    def __init__(self, task: Task) -> None:
        self.task = require_task(task)
        by_class = {"safety": 0, "target": 1, "comfort": 2}
        self.rows: tuple[Requirement, ...] = tuple(
            sorted(task.requirements, key=lambda r: by_class[r.requirement_class])
        )
        self.labels: tuple[str, ...] = tuple(row.label for row in self.rows)
        self.achieves = any(row.kind == "achieve" for row in self.rows)
        self.safety_count = sum(row.requirement_class == "safety" for row in self.rows)
        self.target_row = (
            self.safety_count
            if any(row.requirement_class == "target" for row in self.rows)
            else None
        )
        self.comfort_start = self.safety_count + (self.target_row is not None)
        self.comfort_count = len(self.rows) - self.comfort_start
        self.signals = used_signals(task)
        """Names of the signals that matter."""
        self.leaves: tuple[Comparison, ...] = tuple(
            leaf for row in self.rows for leaf in comparisons(row.predicate)
        )
        self.strict: tuple[bool, ...] = tuple(leaf.strict for leaf in self.leaves)
        self.safety_leaves = sum(
            len(comparisons(row.predicate)) for row in self.rows[: self.safety_count]
        )
        self.ranges: tuple[Interval, ...] = tuple(
            leaf for row in self.rows for leaf in task.analysis.leaves[row.label]
        )
        """Range [l, u] of every leaf's margin."""
        self.soft_lows: tuple[float, ...] = tuple(
            # A comparison that always holds has score 1, whatever its margin: l is then -inf.
            leaf.low if leaf.low < 0.0 else -math.inf
            for leaf in self.ranges[self.safety_leaves :]
        )
        """Lower bound l of every leaf that has a continuous score."""
        self.any_strict = any(self.strict)
        self.compound = len(self.leaves) > len(self.rows)
        self.groups = _groups(task, self.rows)
        self.hard_groups = tuple(
            group for group in self.groups if group.members[0] < self.comfort_start
        )
        """Those of safety and target."""

    def array_margins(self, xp: ModuleType) -> Margins:
        """Margins of the leaves over arrays of a namespace."""
        return _array_margins(self.task, xp)

    def combine(
        self,
        leaves: Sequence[T],
        conjunction: Callable[[Sequence[T]], T],
        disjunction: Callable[[Sequence[T]], T],
    ) -> list[T]:
        """One value a row from one value a leaf, through `and` and `or` of any number of parts."""
        following = iter(leaves)
        return [_fold(row.predicate, following, conjunction, disjunction) for row in self.rows]

    def by_label(self, rows: Sequence[T] | dict[str, T]) -> dict[str, T]:
        """Rows as a mapping from label to value, in the order of the text."""
        found = rows if isinstance(rows, dict) else dict(zip(self.labels, rows, strict=True))
        if self.labels == self.task.labels:
            return found
        return {label: found[label] for label in self.task.labels}


@lru_cache(maxsize=256)
def plan_of(task: Task) -> Plan:
    """The plan of a task; made once a task."""
    return Plan(task)


@lru_cache(maxsize=256)
def _array_margins(task: Task, xp: ModuleType) -> Margins:
    return compile_margins(task, plan_of(task).leaves, xp)


def _fold(
    predicate: Predicate,
    leaves: Iterator[T],
    conjunction: Callable[[Sequence[T]], T],
    disjunction: Callable[[Sequence[T]], T],
) -> T:
    if isinstance(predicate, Comparison):
        return next(leaves)
    parts = [_fold(part, leaves, conjunction, disjunction) for part in predicate.parts]
    return (conjunction if isinstance(predicate, And) else disjunction)(parts)


def _groups(task: Task, rows: Sequence[Requirement]) -> tuple[Group, ...]:
    number: Mapping[str, int] = {row.label: index for index, row in enumerate(rows)}
    members: dict[tuple[int, ...], list[int]] = {}
    for row in rows:
        above = tuple(sorted(number[label] for label in task.order.above[row.label]))
        members.setdefault(above, []).append(number[row.label])
    return tuple(Group(above, tuple(rows)) for above, rows in members.items())
