"""Takes a training's whole state apart, and puts it together again.

Networks, optimisers and counters travel in Stable-Baselines3's own zip; what that leaves out, in
JSON and NumPy arrays, of which nothing is ever executed.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from hprs.training.arrays import pack, unpack
from hprs.training.configuration import Configuration
from hprs.training.episode_log import EpisodeLog, EpisodeState
from hprs.training.random_states import (
    derive_seed,
    generator_state,
    global_states,
    set_generator_state,
    set_global_states,
)
from hprs.training.sb3.model import algorithm_class
from hprs.training.sb3.ring import ReplayRing
from hprs.training.schedules import schedule

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.vec_env import VecEnv

MODEL, STATE, ARRAYS = "model.zip", "state.json", "arrays.npz"


def capture(model: BaseAlgorithm) -> dict[str, bytes]:
    """The state of a training between two rollouts, but for the replay buffer: name to content."""
    episodes = [log.state() for log in _episode_logs(model)]
    monitor, scale = _layers(model)
    arrays = {f"actions {i}": episode.actions for i, episode in enumerate(episodes)}
    arrays |= {"returns": monitor.episode_returns, "lengths": monitor.episode_lengths}
    if scale is not None:
        rms = scale.ret_rms
        arrays |= {"scale": np.array([rms.mean, rms.var, rms.count]), "scaled": scale.returns}
    arrays |= {name: matrix.numpy() for name, matrix in _exploration(model).items()}
    state = {
        "random": global_states(),
        "action_space": generator_state(model.action_space.np_random),
        "episodes": [episode.to_json() for episode in episodes],
        "episode_count": monitor.episode_count,
    }
    return {
        MODEL: _model_bytes(model),
        STATE: json.dumps(state).encode(),
        ARRAYS: pack(arrays),
    }


class Restoration:
    """Brings a training back to where `capture` saw it.

    Args:
        contents: What `capture` returned.
    """

    def __init__(self, contents: Mapping[str, bytes]) -> None:
        self._model = contents[MODEL]
        self._state = json.loads(contents[STATE])
        self._arrays = unpack(contents[ARRAYS])

    def model(self, configuration: Configuration, environments: VecEnv) -> BaseAlgorithm:
        """The model, in environments that have not been reset."""
        from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

        kind, content = algorithm_class(configuration), io.BytesIO(self._model)
        # The class that was chosen when the training began would be taken for the user's choice.
        off_policy = issubclass(kind, OffPolicyAlgorithm)
        again: dict[str, Any] = {"replay_buffer_class": None} if off_policy else {}
        # Schedules are functions of ours, made anew: a pickle names where their code once was.
        made = {name: schedule(value) for name, value in configuration.parameters.items()}
        ours = {name: value for name, value in made.items() if callable(value)}
        return kind.load(
            content,
            env=environments,
            device="cpu",
            custom_objects={"lr_schedule": None, **ours},
            force_reset=False,
            **again,
        )

    def environments(self, model: BaseAlgorithm, seed: int) -> list[str]:
        """Bring the environments back.

        Args:
            model: The model in them.
            seed: The training's seed, for episodes that must be restarted.

        Returns:
            For every restarted episode the reason.
        """
        monitor, scale = _layers(model)
        monitor.episode_returns = self._arrays["returns"]
        monitor.episode_lengths = self._arrays["lengths"]
        monitor.episode_count = self._state["episode_count"]
        if scale is not None:
            rms = scale.ret_rms
            rms.mean, rms.var, rms.count = self._arrays["scale"]
            scale.returns = self._arrays["scaled"]
        reasons: dict[int, str] = {}
        for index, log in enumerate(_episode_logs(model)):
            kept = self._state["episodes"][index]
            reason = log.replay(EpisodeState(actions=self._arrays[f"actions {index}"], **kept))
            if reason:
                reasons[index] = reason
                log.reset(seed=derive_seed(seed, model.num_timesteps, index))
        if reasons:
            _begin_episodes(model, list(reasons))
        return list(reasons.values())

    def random(self, model: BaseAlgorithm) -> None:
        """Bring the generators back, and what was last drawn from them for exploration.

        To be called where a rollout starts: until then Stable-Baselines3 draws numbers itself.
        """
        import torch

        for name, matrix in _exploration(model).items():
            matrix.copy_(torch.from_numpy(self._arrays[name]))
        set_generator_state(model.action_space.np_random, self._state["action_space"])
        set_global_states(self._state["random"])


def replay_ring(model: BaseAlgorithm) -> ReplayRing | None:
    """The model's replay buffer; None for an algorithm without one."""
    buffer = getattr(model, "replay_buffer", None)
    return None if buffer is None else ReplayRing(buffer, model.num_timesteps // model.n_envs)


def _begin_episodes(model: BaseAlgorithm, indices: list[int]) -> None:
    """Tell everything around some environments that they have begun a new episode."""
    from stable_baselines3.common.vec_env import DummyVecEnv, VecTransposeImage, unwrap_vec_wrapper

    monitor, scale = _layers(model)
    monitor.episode_returns[indices], monitor.episode_lengths[indices] = 0.0, 0
    if scale is not None:
        scale.returns[indices] = 0.0
    environments: Any = model.get_env()
    base = environments.unwrapped
    assert isinstance(base, DummyVecEnv)  # noqa: S101
    for position, log in enumerate(_episode_logs(model)):
        base._save_obs(position, log.observation)
    seen: Any = base._obs_from_buf()
    transposed = unwrap_vec_wrapper(environments, VecTransposeImage)
    if transposed is not None:
        seen = transposed.transpose_observations(seen)
    learner: Any = model
    learner._last_obs = seen
    learner._last_original_obs = seen
    learner._last_episode_starts[indices] = True
    ring = replay_ring(model)
    if ring is not None and ring.rows:
        # Returns over several steps must not run from one episode into the other.
        learner.replay_buffer.timeouts[(ring.rows - 1) % ring.capacity, indices] = True


def _episode_logs(model: BaseAlgorithm) -> list[EpisodeLog]:
    environments: Any = model.get_env()
    return environments.unwrapped.envs


def _layers(model: BaseAlgorithm) -> tuple[Any, Any]:
    from stable_baselines3.common.vec_env import VecMonitor, unwrap_vec_wrapper

    environments: Any = model.get_env()
    return unwrap_vec_wrapper(environments, VecMonitor), model.get_vec_normalize_env()


def _exploration(model: BaseAlgorithm) -> dict[str, Any]:
    """The matrices of state-dependent exploration (gSDE), which are parameters of nothing."""
    if not model.use_sde:
        return {}
    learner: Any = model
    actor = learner.actor if hasattr(learner, "actor") else learner.policy
    noise = actor.action_dist
    return {
        name: getattr(noise, name).detach() for name in ("exploration_mat", "exploration_matrices")
    }


def _model_bytes(model: BaseAlgorithm) -> bytes:
    content = io.BytesIO()
    model.save(content)
    return content.getvalue()
