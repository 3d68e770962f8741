"""The rank-preserving reward of rule hierarchies (Veer et al., ICRA 2023)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, ClassVar

from hprs.errors import UsageError
from hprs.rewards.base import PAID_AT_THE_END, Demands, paid_at_the_end
from hprs.semantics.evaluation import Signals
from hprs.semantics.plan import plan_of
from hprs.semantics.robustness import (
    OPERATORS,
    Follower,
    MarginForm,
    Part,
    check_margin_form,
)
from hprs.spec.misuse import shown
from hprs.spec.namespace import Array, namespace_of
from hprs.spec.task import Task

DEFAULT_BASE = 2.01
"""The authors' base a."""

_LARGEST_LOGARITHM = 700.0
"""Of a number that a float can hold, and some of them added up."""


@dataclass(frozen=True)
class RankPreserving:
    """An episode that satisfies more important requirements is always paid more.

    Requirements stand in K levels: first all that nothing is more important than, then all that
    only these are above, and so on. A level's robustness rho_i is that of its least robust
    requirement over the whole episode; `encourage` asks for always, as every rule there is a
    formula. Where an episode ends, for whatever reason, it pays

        sum over levels i = 1 .. K of a ** (K - i + 1) * [rho_i > 0]  +  mean of tanh(rho_i)

    Args:
        task: The task.
        base: The base a, above 2: only then does a level outweigh all below it and the mean.
        margins: Normalised by their bounds and clipped to [-1, 1], or raw, as the authors take
            them; see `hprs.semantics.robustness.MARGIN_FORMS`.

    Raises:
        UsageError: The task has no requirement, the base is not above 2 or too large, the form is
            unknown, or a margin has no bounds to normalise it by.
    """

    task: Task
    base: float = DEFAULT_BASE
    margins: MarginForm = "normalised"
    demands: ClassVar[Demands] = PAID_AT_THE_END

    def __post_init__(self) -> None:
        """Check task, base and margins."""
        count = len(levels(self.task))
        if not count:
            raise UsageError("rank-preserving orders requirements, and this task has none.")
        base: Any = self.base
        number = isinstance(base, int | float) and not isinstance(base, bool)
        if not (number and base > 2.0 and count * math.log(base) < _LARGEST_LOGARITHM):
            raise UsageError(
                f"base must be a number above 2 whose power {count}, the number of levels, is "
                f"finite; got {shown(self.base)}."
            )
        check_margin_form(self.task, self.margins)

    @cached_property
    def _follower(self) -> Follower:
        return Follower(self.task, levels(self.task), self.margins)

    def init(self, signals: Signals) -> tuple[Array, ...]:
        """Robustness of the levels over s_0."""
        return self._follower.begin(signals)

    def step(
        self, memory: tuple[Array, ...], signals: Signals, terminated: Array, truncated: Array
    ) -> tuple[tuple[Array, ...], Array]:
        """Robustness of the levels so far; what the episode is worth, where it ends."""
        running = self._follower.advance(memory, signals)
        return running, paid_at_the_end(self._worth, running, terminated, truncated)

    def _worth(self, *running: Array) -> Array:
        count = len(running)
        satisfied: Array = 0.0
        total: Array = 0.0
        for number, value in enumerate(running):
            satisfied = satisfied + self.base ** (count - number) * _is_positive(value)
            total = total + _tanh(value)
        return satisfied + total / count


@lru_cache(maxsize=256)
def levels(task: Task) -> tuple[Part, ...]:
    """The levels of importance of a task's requirements, the most important first.

    A requirement's level is one more than the longest chain of more important ones.
    """
    plan, above = plan_of(task), task.order.above
    level: dict[str, int] = {}
    # What is above another has fewer above itself, since the order is transitive.
    for label in sorted(plan.labels, key=lambda label: len(above[label])):
        level[label] = 1 + max((level[higher] for higher in above[label]), default=0)
    members: dict[int, list[int]] = {}
    for row, label in enumerate(plan.labels):
        members.setdefault(level[label], []).append(row)
    return tuple(
        Part(OPERATORS[plan.rows[rows[0]].kind], tuple(rows)) for _, rows in sorted(members.items())
    )


def _is_positive(value: Array) -> Array:
    if isinstance(value, float):
        return float(value > 0.0)
    return namespace_of((value,)).astype(value > 0.0, value.dtype)


def _tanh(value: Array) -> Array:
    return math.tanh(value) if isinstance(value, float) else namespace_of((value,)).tanh(value)
