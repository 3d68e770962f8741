"""The base reward: 1 in every state that meets the target, 0 in all others."""

from __future__ import annotations

from hprs.rewards.base import StateReward
from hprs.semantics.evaluation import Evaluation, Signals, evaluate
from hprs.semantics.plan import plan_of
from hprs.spec.namespace import Array
from hprs.spec.task import Task


def sparse(task: Task) -> StateReward:
    """The paper's base reward R(s, a, s') (section "Base reward"); 0 where there is no target."""
    return StateReward(task, _paid)


def _paid(task: Task, signals: Signals) -> Array:
    return base_reward(plan_of(task).target_row, evaluate(task, signals))


def base_reward(target_row: int | None, evaluation: Evaluation) -> Array:
    """R(s, a, s') from the evaluation of s'; the row of the target is None where there is none."""
    if target_row is None:
        return evaluation.potential * 0.0
    met = evaluation.satisfied[target_row]
    return 1.0 if met is True else 0.0 if met is False else met * 1.0
