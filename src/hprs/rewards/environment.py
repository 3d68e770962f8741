"""The environment's own reward, unchanged (the paper's baseline "Shaped")."""

from __future__ import annotations

from hprs.rewards.base import StateReward
from hprs.semantics.evaluation import Signals
from hprs.spec.namespace import Array
from hprs.spec.task import ENV_REWARD, Task


def environment_reward(task: Task) -> StateReward:
    """Passes on the reward that travels among the signals under the reserved name `env_reward`."""
    return StateReward(task, _paid)


def _paid(task: Task, signals: Signals) -> Array:
    del task
    return signals[ENV_REWARD]
