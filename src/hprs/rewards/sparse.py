"""The base reward: 1 in every state that meets the target, 0 in all others."""

from __future__ import annotations

from dataclasses import dataclass

from hprs.semantics.evaluation import Evaluation, Signals, evaluate
from hprs.semantics.plan import plan_of
from hprs.spec.namespace import Array
from hprs.spec.task import Task


@dataclass(frozen=True)
class Sparse:
    """The paper's base reward R(s, a, s') (section "Base reward"); 0 where there is no target."""

    task: Task

    def init(self, signals: Signals) -> None:
        """Nothing to remember."""
        del signals

    def step(
        self, memory: None, signals: Signals, terminated: Array, truncated: Array
    ) -> tuple[None, Array]:
        """1 where the target's predicate holds in the state reached."""
        del memory, terminated, truncated
        return None, base_reward(plan_of(self.task).target_row, evaluate(self.task, signals))


def base_reward(target_row: int | None, evaluation: Evaluation) -> Array:
    """R(s, a, s') from the evaluation of s'; the row of the target is None where there is none."""
    if target_row is None:
        return evaluation.potential * 0.0
    met = evaluation.satisfied[target_row]
    return 1.0 if met is True else 0.0 if met is False else met * 1.0
