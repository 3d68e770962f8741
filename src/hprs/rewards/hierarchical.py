"""Hierarchical potential-based reward shaping (HPRS): the paper's main contribution."""

from __future__ import annotations

from dataclasses import dataclass

from hprs.rewards.shaping import DEFAULT_END, End, check_convention, potential_difference
from hprs.rewards.state import base_reward
from hprs.semantics.evaluation import Signals, evaluate, hard_potential
from hprs.semantics.plan import Evaluation, plan_of
from hprs.spec.namespace import Array
from hprs.spec.task import Task


@dataclass(frozen=True)
class Hierarchical:
    """Base reward plus the difference of hierarchical potentials (the paper, equation `hrs`).

    Args:
        task: The task.
        end: The convention at the end of an episode; see `hprs.rewards.shaping`.
        discount: The learner's discount in (0, 1]; `"invariant"` needs it, the others ignore it.
        comfort: Whether comfort requirements count; without them it is the paper's ablation.

    Raises:
        UsageError: Unknown `end`, or a discount that is missing or outside (0, 1].
    """

    task: Task
    end: End = DEFAULT_END
    discount: float | None = None
    comfort: bool = True

    def __post_init__(self) -> None:
        """Check the convention and its discount."""
        check_convention(self.end, self.discount)

    def init(self, signals: Signals) -> Array:
        """Psi(s_0)."""
        return self._potential(evaluate(self.task, signals))

    def step(
        self, memory: Array, signals: Signals, terminated: Array, truncated: Array
    ) -> tuple[Array, Array]:
        """Psi(s') and the shaped reward of the transition into s'."""
        evaluation = evaluate(self.task, signals)
        potential = self._potential(evaluation)
        shaping = potential_difference(
            self.end,
            self.discount,
            memory,
            potential,
            terminated=terminated,
            truncated=truncated,
        )
        return potential, base_reward(plan_of(self.task).target_row, evaluation) + shaping

    def _potential(self, evaluation: Evaluation) -> Array:
        return evaluation.potential if self.comfort else hard_potential(self.task, evaluation)
