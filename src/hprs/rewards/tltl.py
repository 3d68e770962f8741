"""TLTL: the robustness of the whole episode, paid at its end (Li et al., 2017)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from hprs.rewards.base import PAID_AT_THE_END, Demands, paid_at_the_end
from hprs.semantics.evaluation import Signals
from hprs.semantics.plan import plan_of
from hprs.semantics.robustness import (
    Follower,
    MarginForm,
    check_margin_form,
    formula,
    least_of,
    require_formula,
)
from hprs.spec.namespace import Array
from hprs.spec.task import Task


@dataclass(frozen=True)
class EpisodeRobustness:
    """Robustness of "always safe, and eventually on target", once, where an episode ends.

    `ensure` asks for always, `achieve` for eventually, `conquer` for eventually always; the whole
    is their minimum. Comfort is not in the formula. A time limit pays as any other end does. Memory
    and time of a step do not grow with the episode.

    Args:
        task: The task.
        margins: Normalised by their bounds and clipped to [-1, 1], or raw; see
            `hprs.semantics.robustness.MARGIN_FORMS`.

    Raises:
        UsageError: The task has neither safety nor target requirements, the form is unknown, or a
            margin has no bounds to normalise it by.
    """

    task: Task
    margins: MarginForm = "normalised"
    demands: ClassVar[Demands] = PAID_AT_THE_END

    def __post_init__(self) -> None:
        """Check task and margins."""
        require_formula(self.task, "tltl")
        check_margin_form(self.task, self.margins, rows=plan_of(self.task).comfort_start)

    @cached_property
    def _follower(self) -> Follower:
        return Follower(self.task, formula(self.task), self.margins)

    def init(self, signals: Signals) -> tuple[Array, ...]:
        """Robustness of the parts over s_0."""
        return self._follower.begin(signals)

    def step(
        self, memory: tuple[Array, ...], signals: Signals, terminated: Array, truncated: Array
    ) -> tuple[tuple[Array, ...], Array]:
        """Robustness of the parts so far; that of the whole, where the episode ends."""
        running = self._follower.advance(memory, signals)
        return running, paid_at_the_end(_worth, running, terminated, truncated)


def _worth(*running: Array) -> Array:
    return least_of(running)
