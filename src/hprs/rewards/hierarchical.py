"""Hierarchical potential-based reward shaping (HPRS): the paper's main contribution."""

from __future__ import annotations

from dataclasses import dataclass

from hprs.rewards.shaping import DEFAULT_END, End, PotentialBased, check_convention
from hprs.semantics.evaluation import hard_potential
from hprs.semantics.plan import Evaluation
from hprs.spec.namespace import Array
from hprs.spec.task import Task


@dataclass(frozen=True)
class Hierarchical(PotentialBased):
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

    def _potential(self, evaluation: Evaluation) -> Array:
        return evaluation.potential if self.comfort else hard_potential(self.task, evaluation)
