"""Registers Pendulum-v1 with actions from -1 to 1, in which both trainers' policies think alike."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
from gymnasium.envs.classic_control import PendulumEnv
from gymnasium.wrappers import RescaleAction


def make(**options: Any) -> gym.Env[Any, Any]:
    """The pendulum; its time limit is that of the original."""
    return RescaleAction(PendulumEnv(**options), -1.0, 1.0)


gym.register("ScaledPendulum-v1", entry_point=make, max_episode_steps=200)
