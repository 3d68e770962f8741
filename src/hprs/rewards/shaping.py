"""What potential-based rewards share: base reward, potential difference, end of an episode.

`end` chooses the convention at the end of an episode and the discount in the shaping:

- `"paper"`: R + Psi(s') - Psi(s) on every transition, as printed. With a learner's discount g
  below 1 this adds (1 - g) * Psi(s') a step and does not keep the optimal policy.
- `"invariant"`: R + g * Psi(s') - Psi(s), with Psi = 0 after termination (Ng et al., 1999);
  keeps the optimal policy for the learner's discount g.
- `"released"`: as `"paper"`, but no shaping on the last transition, as the paper's code does.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Literal, TypeAlias, get_args

from hprs.errors import UsageError, did_you_mean
from hprs.rewards.state import base_reward
from hprs.semantics.evaluation import Signals, evaluate
from hprs.semantics.plan import Evaluation, plan_of
from hprs.spec.namespace import Array, select
from hprs.spec.task import Task

End: TypeAlias = Literal["paper", "invariant", "released"]
ENDS: tuple[End, ...] = get_args(End)
"""How shaping treats the end of an episode."""

DEFAULT_END: End = "paper"
"""What is taken unless something else is asked for; the only place that says so."""


class PotentialBased(ABC):
    """Base reward plus the difference of one potential; a subclass says which."""

    task: Task
    end: End
    discount: float | None

    @abstractmethod
    def _potential(self, evaluation: Evaluation) -> Array:
        """Psi of a state."""

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


def potential_difference(
    end: End,
    discount: float | None,
    before: Array,
    after: Array,
    *,
    terminated: Array,
    truncated: Array,
) -> Array:
    """The shaping of a transition from potential `before` to potential `after`."""
    if end == "invariant":
        # Psi is 0 in the absorbing state, so the optimal policy is unchanged (Ng et al., 1999).
        kept = select(terminated, after * 0.0, after)
        return kept * (discount or math.nan) - before
    shaping = after - before
    if end == "released":
        return select(terminated | truncated, shaping * 0.0, shaping)
    return shaping


def check_convention(end: str, discount: float | None) -> None:
    """Refuse what no potential-based reward could use.

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
