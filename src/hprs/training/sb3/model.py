"""Builds the environments and the model of a training."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np

from hprs.errors import RunError, UsageError
from hprs.training.algorithms import TRAINERS
from hprs.training.configuration import Configuration
from hprs.training.environment import make_configured
from hprs.training.episode_log import EpisodeLog
from hprs.training.sb3.settings import hyperparameters
from hprs.training.schedules import schedule

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.vec_env import VecEnv

_SLACK = 10_000
"""Steps by which a training may pass its end: those of the rollout that reaches it."""


def make_vector(configuration: Configuration) -> VecEnv:
    """Environments with the task inside, so that shaping sees every episode's own end."""
    from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize

    count = configuration.parameters["environments"]
    vector: VecEnv = DummyVecEnv([lambda: _make_single(configuration)] * count)
    vector = VecMonitor(vector)
    if not configuration.parameters["scale_reward"]:
        return vector
    return VecNormalize(vector, norm_obs=False, gamma=configuration.parameters["gamma"])


def make_model(configuration: Configuration, environments: VecEnv) -> BaseAlgorithm:
    """A model that has learned nothing yet.

    Raises:
        UsageError: Stable-Baselines3 refuses the hyper-parameters or the spaces.
    """
    kind = algorithm_class(configuration)
    try:
        return kind(
            _policy_name(environments.observation_space),
            environments,
            seed=configuration.seed,
            device="cpu",
            **_arguments(kind, configuration, environments),
        )
    # What is wrong inside `policy_kwargs` or too large for the memory comes as any of these.
    except (AssertionError, ValueError, TypeError, RuntimeError, MemoryError) as error:
        raise UsageError(f"Stable-Baselines3 refuses this training: {error}") from error


def refuse_divergence(model: BaseAlgorithm) -> None:
    """See that the networks hold numbers: no step of learning brings back NaN or infinity.

    Raises:
        RunError: They do not.
    """
    weights = [*model.policy.parameters()]
    # SAC's entropy coefficient is learned, and no parameter of its networks.
    entropy = getattr(model, "log_ent_coef", None)
    if all(bool(w.isfinite().all()) for w in [*weights, *([] if entropy is None else [entropy])]):
        return
    raise RunError(
        f"the training diverged before step {model.num_timesteps:,}: its networks hold NaN or "
        "infinity. A smaller learning_rate is the first thing to try."
    )


def algorithm_class(configuration: Configuration) -> Any:
    """The class of Stable-Baselines3 that trains."""
    import stable_baselines3

    return getattr(stable_baselines3, TRAINERS["sb3"][configuration.algorithm].class_name)


class _Terse(gym.Wrapper[Any, Any, Any, Any]):
    """What a learner sees of a step.

    `info` is empty: Stable-Baselines3 copies it deeply at every step, and no learner reads it.
    Where nothing is to be expected after the horizon, an episode that it cuts off has terminated.
    The task's reward and assessment, below, still tell one from the other.
    """

    def __init__(self, env: gym.Env[Any, Any], *, horizon_is_terminal: bool) -> None:
        super().__init__(env)
        self._horizon_is_terminal = horizon_is_terminal

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        observation, reward, terminated, truncated, _ = self.env.step(action)
        if self._horizon_is_terminal:
            terminated, truncated = terminated or truncated, False
        return observation, reward, terminated, truncated, {}


def _make_single(configuration: Configuration) -> gym.Env[Any, Any]:
    made = make_configured(configuration)
    return EpisodeLog(_Terse(made, horizon_is_terminal=configuration.horizon_is_terminal))


def _arguments(
    kind: type[BaseAlgorithm], configuration: Configuration, environments: VecEnv
) -> dict[str, Any]:
    parameters = configuration.parameters
    chosen = {name: schedule(parameters[name]) for name in hyperparameters(kind)}
    chosen["policy_kwargs"] = {
        "net_arch": parameters["net_arch"],
        **(parameters["policy_kwargs"] or {}),
    }
    if isinstance(chosen.get("train_freq"), list):
        chosen["train_freq"] = tuple(chosen["train_freq"])
    if "buffer_size" in chosen:
        # A longer buffer than the training would only take memory.
        chosen["buffer_size"] = min(chosen["buffer_size"], configuration.steps + _SLACK)
    names = inspect.signature(kind.__init__).parameters
    if parameters["action_noise"] > 0.0 and "action_noise" in names:
        from stable_baselines3.common.noise import NormalActionNoise

        shape = environments.action_space.shape or ()
        deviation = np.full(shape, parameters["action_noise"])
        chosen["action_noise"] = NormalActionNoise(np.zeros(shape), deviation)
    return chosen


def _policy_name(space: gym.Space[Any]) -> str:
    from stable_baselines3.common.preprocessing import is_image_space

    if isinstance(space, gym.spaces.Dict):
        return "MultiInputPolicy"
    return "CnnPolicy" if is_image_space(space) else "MlpPolicy"
