"""What evaluating a task needs, derived once: requirements as rows, in the order of their classes.

All arrays of the semantics have the requirements on their first axis: safety rows first, then the
target, then comfort; inside a class the order of the text. The batch axes follow.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, reduce
from types import ModuleType
from typing import Any, TypeAlias, TypeVar

from hprs.spec.compiler import Margins, compile_margins, used_signals
from hprs.spec.expression import And, Comparison, Predicate, comparisons
from hprs.spec.namespace import both, either, float_operations
from hprs.spec.task import Requirement, Task

T = TypeVar("T")


Pick: TypeAlias = Callable[[Sequence[float]], Sequence[float]]
FromLeaves: TypeAlias = Callable[[Sequence[float]], Any]


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
        self.task = task
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
        self.soft_lows: tuple[float, ...] = tuple(
            # A comparison that always holds has score 1, whatever its margin: l is then -inf.
            low if low < 0.0 else -math.inf
            for row in self.rows[self.safety_count :]
            for low in task.analysis.lows[row.label]
        )
        """Lower bound l of every leaf that has a continuous score."""
        self.any_strict = any(self.strict)
        self.compound = len(self.leaves) > len(self.rows)
        self.groups = _groups(task, self.rows)

    def float_margins(self, signals: Mapping[str, float]) -> tuple[list[float], list[float]]:
        """Margins of the rows and of their leaves in one state of floats."""
        compiled = self._float_leaves
        leaves = (
            compiled(signals) if compiled.definitions else [f(signals) for f in compiled.functions]  # type: ignore[arg-type]
        )
        if not self.compound:
            return leaves, leaves
        return [row(leaves) for row in self._float_rows], leaves

    @cached_property
    def _float_leaves(self) -> Margins:
        return compile_margins(self.task, self.leaves, None)

    @cached_property
    def _float_rows(self) -> list[FromLeaves]:
        return self._per_row(
            lambda leaf: operator.itemgetter(leaf),
            float_operations()["min"],
            float_operations()["max"],
        )

    @cached_property
    def float_satisfied(self) -> list[FromLeaves]:
        """One function a row, from the leaves' margins to whether the row is satisfied."""

        def holds(leaf: int) -> FromLeaves:
            if self.strict[leaf]:
                return lambda leaves: leaves[leaf] > 0.0
            return lambda leaves: leaves[leaf] >= 0.0

        return self._per_row(holds, both, either)

    @cached_property
    def float_scores(self) -> list[FromLeaves]:
        """One function a row below safety, from the leaves' margins to the row's score."""

        def score(leaf: int) -> FromLeaves:
            low = self.soft_lows[leaf - self.safety_leaves] if leaf >= self.safety_leaves else -1.0

            def continuous(leaves: Sequence[float]) -> float:
                value = leaves[leaf]
                return (
                    1.0
                    if value >= 0.0
                    else value
                    if value != value
                    else max(1.0 - value / low, 0.0)
                )

            return continuous

        minimum, maximum = float_operations()["min"], float_operations()["max"]
        return self._per_row(score, minimum, maximum)[self.safety_count :]

    def _per_row(
        self, from_leaf: Callable[[int], FromLeaves], conjunction: Any, disjunction: Any
    ) -> list[FromLeaves]:
        def lift(operation: Any) -> Callable[[FromLeaves, FromLeaves], FromLeaves]:
            return lambda f, g: lambda leaves: operation(f(leaves), g(leaves))

        functions = [from_leaf(leaf) for leaf in range(len(self.leaves))]
        return self.combine(functions, lift(conjunction), lift(disjunction))

    @cached_property
    def float_potential(self) -> Callable[[Sequence[float]], float]:
        """The potential from the rows' scores."""
        groups = [(_picker(group.above), _picker(group.members)) for group in self.groups]
        prod = math.prod

        def general(scores: Sequence[float]) -> float:
            total = 0.0
            for above, members in groups:
                total += prod(above(scores)) * sum(members(scores))
            return total

        def chain(scores: Sequence[float]) -> float:
            # Every group lies below all groups before it: one running product is its weight.
            total, weight = 0.0, 1.0
            for _, members in groups:
                own = members(scores)
                total += weight * sum(own)
                weight *= prod(own)
            return total

        return chain if self._is_chain else general

    @property
    def _is_chain(self) -> bool:
        before: set[int] = set()
        for group in self.groups:
            if set(group.above) != before:
                return False
            before |= set(group.members)
        return True

    def array_margins(self, xp: ModuleType) -> Margins:
        """Margins of the leaves over arrays of a namespace."""
        return _array_margins(self.task, xp)

    def combine(
        self,
        leaves: Sequence[T],
        conjunction: Callable[[T, T], T],
        disjunction: Callable[[T, T], T],
    ) -> list[T]:
        """One value a row from one value a leaf, through `and` and `or`."""
        following = iter(leaves)
        return [_fold(row.predicate, following, conjunction, disjunction) for row in self.rows]

    def by_label(self, rows: Sequence[T]) -> dict[str, T]:
        """Rows as a mapping from label to value, in the order of the text."""
        if self.labels == self.task.labels:
            return dict(zip(self.labels, rows, strict=True))
        found = dict(zip(self.labels, rows, strict=True))
        return {label: found[label] for label in self.task.labels}


@lru_cache(maxsize=256)
def plan_of(task: Task) -> Plan:
    """The plan of a task; made once a task."""
    return Plan(task)


@lru_cache(maxsize=256)
def _array_margins(task: Task, xp: ModuleType) -> Margins:
    return compile_margins(task, plan_of(task).leaves, xp)


def _picker(rows: tuple[int, ...]) -> Pick:
    if not rows:
        return lambda scores: ()
    if rows == tuple(range(rows[0], rows[-1] + 1)):
        return operator.itemgetter(slice(rows[0], rows[-1] + 1))
    return lambda scores: [scores[row] for row in rows]


def _fold(
    predicate: Predicate,
    leaves: Iterator[T],
    conjunction: Callable[[T, T], T],
    disjunction: Callable[[T, T], T],
) -> T:
    if isinstance(predicate, Comparison):
        return next(leaves)
    parts: list[Any] = [_fold(part, leaves, conjunction, disjunction) for part in predicate.parts]
    return reduce(conjunction if isinstance(predicate, And) else disjunction, parts)


def _groups(task: Task, rows: Sequence[Requirement]) -> tuple[Group, ...]:
    number: Mapping[str, int] = {row.label: index for index, row in enumerate(rows)}
    members: dict[tuple[int, ...], list[int]] = {}
    for row in rows:
        above = tuple(sorted(number[label] for label in task.order.above[row.label]))
        members.setdefault(above, []).append(number[row.label])
    return tuple(Group(above, tuple(rows)) for above, rows in members.items())
