"""A native vector environment with its task, as Stable-Baselines3's vector environments are."""

from __future__ import annotations

from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from hprs.training.configuration import Configuration
from hprs.training.host import make_host


class NativeVector(VecEnv):
    """All environments of a training in one call.

    Args:
        configuration: The training.
        number: How many environments.
    """

    def __init__(self, configuration: Configuration, number: int) -> None:
        self._host = make_host(configuration, number)
        super().__init__(number, self._host.observation_space, self._host.action_space)

    def reset(self) -> np.ndarray:
        """New episodes."""
        return self._host.reset(0).observation

    def step_async(self, actions: np.ndarray) -> None:
        """Remember the actions."""
        self._actions = actions

    def step_wait(self) -> Any:
        """Step all environments; what an episode ended with is in its info."""
        made = self._host.step(self._actions)
        ended = made.terminated | made.truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(ended):
            infos[row]["terminal_observation"] = made.reached.observation[row]
            infos[row]["TimeLimit.truncated"] = bool(made.truncated[row] & ~made.terminated[row])
        return made.next.observation, made.reward, ended, infos

    def close(self) -> None:
        """Close them."""
        self._host.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """None, for all that is asked."""
        return [None] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Nothing can be set."""

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> Any:
        """Nothing can be called."""
        return [None] * self.num_envs

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """No environment is."""
        return [False] * self.num_envs
