"""Rewards of the state reached alone: base reward, the environment's own, and the safety cost."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hprs.semantics.assessment import violations
from hprs.semantics.evaluation import Signals, evaluate
from hprs.semantics.plan import Evaluation, plan_of
from hprs.spec.namespace import Array
from hprs.spec.task import ENV_REWARD, Task


@dataclass(frozen=True)
class StateReward:
    """A reward of the state reached: nothing is remembered, and no end of an episode matters.

    Args:
        task: The task.
        paid: The reward of a state, from the task and the state's signals.
    """

    task: Task
    paid: Callable[[Task, Signals], Array]

    def init(self, signals: Signals) -> None:
        """Nothing to remember."""
        del signals

    def step(
        self, memory: None, signals: Signals, terminated: Array, truncated: Array
    ) -> tuple[None, Array]:
        """What the state reached is worth."""
        del memory, terminated, truncated
        return None, self.paid(self.task, signals)


def sparse(task: Task) -> StateReward:
    """The paper's base reward R(s, a, s') (section "Base reward"); 0 where there is no target."""
    return StateReward(task, _base)


def environment_reward(task: Task) -> StateReward:
    """The environment's own reward, unchanged (the paper's baseline "Shaped")."""
    return StateReward(task, _own)


def safety_cost(task: Task) -> StateReward:
    """How many safety requirements the state reached violates, for constrained learners.

    The wrappers report the same number as `info["cost"]`, beside any reward.
    """
    return StateReward(task, _cost)


def base_reward(target_row: int | None, evaluation: Evaluation) -> Array:
    """R(s, a, s') from the evaluation of s'; the row of the target is None where there is none."""
    if target_row is None:
        return evaluation.potential * 0.0
    met = evaluation.satisfied[target_row]
    return 1.0 if met is True else 0.0 if met is False else met * 1.0


def _base(task: Task, signals: Signals) -> Array:
    return base_reward(plan_of(task).target_row, evaluate(task, signals))


def _own(task: Task, signals: Signals) -> Array:
    # It travels among the signals under this reserved name.
    del task
    return signals[ENV_REWARD]


def _cost(task: Task, signals: Signals) -> Array:
    return violations(plan_of(task), evaluate(task, signals))
