"""Hierarchical potential-based reward shaping (HPRS): the paper's main contribution."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeAlias, get_args

from hprs.errors import UsageError, did_you_mean
from hprs.rewards.sparse import base_reward
from hprs.semantics.evaluation import Signals, evaluate
from hprs.semantics.plan import plan_of
from hprs.spec.namespace import Array, select
from hprs.spec.task import Task

End: TypeAlias = Literal["paper", "invariant", "released"]
ENDS: tuple[End, ...] = get_args(End)
"""How shaping treats the end of an episode; see `Hierarchical`."""

DEFAULT_END: End = "paper"
"""What is taken unless something else is asked for; the only place that says so."""


@dataclass(frozen=True)
class Hierarchical:
    """Base reward plus the difference of hierarchical potentials (the paper, equation `hrs`).

    `end` chooses the convention at the end of an episode and the discount in the shaping:

    - `"paper"`: R + Psi(s') - Psi(s) on every transition, as printed. With a learner's discount g
      below 1 this adds (1 - g) * Psi(s') a step and does not keep the optimal policy.
    - `"invariant"`: R + g * Psi(s') - Psi(s), with Psi = 0 after termination (Ng et al., 1999);
      keeps the optimal policy for the learner's discount g.
    - `"released"`: as `"paper"`, but no shaping on the last transition, as the paper's code does.

    Args:
        task: The task.
        end: The convention.
        discount: The learner's discount in (0, 1]; `"invariant"` needs it, the others ignore it.

    Raises:
        UsageError: Unknown `end`, or a discount that is missing or outside (0, 1].
    """

    task: Task
    end: End = DEFAULT_END
    discount: float | None = None

    def __post_init__(self) -> None:
        """Check the convention and its discount."""
        check_convention(self.end, self.discount)

    @cached_property
    def _target_row(self) -> int | None:
        return plan_of(self.task).target_row

    def init(self, signals: Signals) -> Array:
        """Psi(s_0)."""
        return evaluate(self.task, signals).potential

    def step(
        self, memory: Array, signals: Signals, terminated: Array, truncated: Array
    ) -> tuple[Array, Array]:
        """Psi(s') and the shaped reward of the transition into s'."""
        evaluation = evaluate(self.task, signals)
        potential = evaluation.potential
        if self.end == "invariant":
            # Psi is 0 in the absorbing state, so the optimal policy is unchanged (Ng et al., 1999).
            after = select(terminated, potential * 0.0, potential)
            shaping = after * (self.discount or math.nan) - memory
        else:
            shaping = potential - memory
            if self.end == "released":
                shaping = select(terminated | truncated, shaping * 0.0, shaping)
        return potential, base_reward(self._target_row, evaluation) + shaping


def check_convention(end: str, discount: float | None) -> None:
    """Refuse what `Hierarchical` could not use.

    Raises:
        UsageError: Unknown `end`, or a discount that is missing or outside (0, 1].
    """
    if end not in ENDS:
        raise UsageError(
            f"unknown end '{end}'; choose one of {', '.join(ENDS)}.{did_you_mean(end, ENDS)}"
        )
    if end == "invariant" and discount is None:
        raise UsageError("end='invariant' needs the learner's discount, as in discount=0.99.")
    if discount is not None and not 0.0 < discount <= 1.0:
        raise UsageError(f"discount must lie in (0, 1], got {discount}.")
