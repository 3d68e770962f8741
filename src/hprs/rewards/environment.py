"""The environment's own reward, unchanged (the paper's baseline "Shaped")."""

from __future__ import annotations

from dataclasses import dataclass

from hprs.semantics.evaluation import Signals
from hprs.spec.namespace import Array
from hprs.spec.task import ENV_REWARD, Task


@dataclass(frozen=True)
class EnvironmentReward:
    """Passes on the reward that travels among the signals under the reserved name `env_reward`."""

    task: Task

    def init(self, signals: Signals) -> None:
        """Nothing to remember."""
        del signals

    def step(
        self, memory: None, signals: Signals, terminated: Array, truncated: Array
    ) -> tuple[None, Array]:
        """The environment's reward of the transition."""
        del memory, terminated, truncated
        return None, signals[ENV_REWARD]
