"""Steps a Gymnasium vector environment, in each of its three autoreset modes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv

from hprs.semantics.plan import plan_of
from hprs.training.host.interface import Seen, Transition
from hprs.training.random_states import training_seed
from hprs.wrappers.vector import TaskVectorWrapper

CANNOT_COME_BACK = "a vector environment's state cannot be brought back"


class VectorEnvironments:
    """A vector environment with a task.

    Args:
        environments: What `hprs.wrap_vector` returns.
    """

    def __init__(self, environments: TaskVectorWrapper) -> None:
        self._environments = environments
        self.number = environments.num_envs
        self.observation_space = environments.single_observation_space
        self.action_space = environments.single_action_space
        self._mode = AutoresetMode(
            environments.metadata.get("autoreset_mode", AutoresetMode.NEXT_STEP)
        )
        self._names = plan_of(environments.task).signals
        self._seed, self._steps = 0, 0
        self._ended = np.zeros(self.number, bool)
        self._seen: Seen | None = None

    @property
    def seen(self) -> Seen:
        """What the next actions are chosen from."""
        assert self._seen is not None, "reset() comes first"  # noqa: S101
        return self._seen

    def reset(self, seed: int) -> Seen:
        """New episodes everywhere; the seeds of the environments are derived from one."""
        self._seed, self._steps = seed, 0
        return self._begin()

    def step(self, actions: np.ndarray) -> Transition:
        """Step all environments."""
        environments = self._environments
        observation, reward, terminated, truncated, infos = environments.step(actions)
        terminated, truncated = np.array(terminated, bool), np.array(truncated, bool)
        valid, ended = ~self._ended, terminated | truncated
        self._steps += 1
        reached = following = self._newest(observation)
        if self._mode == AutoresetMode.NEXT_STEP:
            self._ended = ended
        elif ended.any():
            final = reached.observation
            if self._mode == AutoresetMode.SAME_STEP:
                final = reached.observation.copy()
                for row in np.flatnonzero(ended):
                    final[row] = np.ravel(infos["final_obs"][row])
            else:
                observation, _ = environments.reset(options={"reset_mask": ended})
                following = self._newest(observation)
            reached = Seen(final, self._columns(environments.reached_signal_values))
        self._seen = following
        return Transition(
            reward=np.array(reward, np.float32),
            terminated=terminated,
            truncated=truncated,
            valid=valid,
            reached=reached,
            next=following,
        )

    def state(self) -> dict[str, Any]:
        """What `restore` needs: name to a JSON value."""
        return {"seed": self._seed, "steps": self._steps}

    def restore(self, state: Mapping[str, Any]) -> list[str]:
        """Begin new episodes everywhere, with other seeds than those before.

        Returns:
            For every environment the reason.
        """
        self._seed, self._steps = state["seed"], state["steps"]
        self._begin()
        return [CANNOT_COME_BACK] * self.number

    def close(self) -> None:
        """Close all environments."""
        self._environments.close()

    def _begin(self) -> Seen:
        seed: Any = training_seed(self._seed, self._steps)
        if isinstance(self._environments.unwrapped, SyncVectorEnv | AsyncVectorEnv):
            rows = range(self.number)
            seed = [training_seed(self._seed, self._steps, row) for row in rows]
        observation, _ = self._environments.reset(seed=seed)
        self._ended = np.zeros(self.number, bool)
        self._seen = self._newest(observation)
        return self._seen

    def _newest(self, observation: Any) -> Seen:
        # A copy: an environment may reuse its buffers.
        copied = np.array(observation, np.float32).reshape(self.number, -1)
        return Seen(copied, self._columns(self._environments.signal_values))

    def _columns(self, values: Mapping[str, Any]) -> np.ndarray:
        if not self._names:
            return np.empty((self.number, 0), np.float32)
        return np.column_stack([values[name] for name in self._names]).astype(np.float32)
