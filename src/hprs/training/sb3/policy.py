"""Policies that Stable-Baselines3 has trained."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hprs.errors import UsageError
from hprs.training.checkpoint import Checkpoint
from hprs.training.environment import require
from hprs.training.run_directory import RunDirectory, Which
from hprs.training.sb3.state import MODEL

POLICY = "policy.zip"

_UNUSED = {"learning_rate": 0.0, "lr_schedule": None, "clip_range": 0.0, "clip_range_vf": None}
"""What a policy that only acts need not unpickle; its code may have moved since."""

_MARKS = {
    "PPO": "clip_range",
    "SAC": "target_entropy",
    "TD3": "target_policy_noise",
    "DQN": "exploration_rate",
}
"""An attribute that only one family of algorithms has; A2C has none of them."""


@dataclass(frozen=True)
class Learner:
    """A policy trained by Stable-Baselines3, acting deterministically."""

    model: Any

    @property
    def spaces(self) -> tuple[Any, Any]:
        """The observation and the action space that it was trained with."""
        return self.model.observation_space, self.model.action_space

    def __call__(self, observation: Any, /) -> Any:
        """The action to take."""
        return self.batch([observation])[0]

    def batch(self, observations: Sequence[Any]) -> Sequence[Any]:
        """One action for each observation."""
        with threads(1):
            return list(self.model.predict(stack(observations), deterministic=True)[0])


def save_policies(run: RunDirectory, checkpoint: Checkpoint) -> None:
    """Keep the checkpoint's model as last or best policy, if it is and has not been kept yet."""
    progress = checkpoint.progress
    kept: tuple[tuple[Which, int], ...] = (
        ("last", progress.evaluated),
        ("best", progress.best_step),
    )
    for which, step in kept:
        if step == progress.step and run.policy_step(which) != step:
            data = checkpoint.contents[MODEL]
            run.save_policy(which, trainer="sb3", step=step, name=POLICY, data=data)


def load_policy(run: RunDirectory, which: Which) -> Learner:
    """A policy that a run keeps.

    Raises:
        RunError: There is none, or it is damaged.
    """
    return load_zip(run.policy_file(which))


def load_zip(path: Path) -> Learner:
    """A policy in a file that Stable-Baselines3 wrote. Such a file can execute code.

    Raises:
        UsageError: The file does not exist, is not such a file, or another library's policy.
    """
    stable_baselines3 = require("stable_baselines3", "sb3")
    from stable_baselines3.common.save_util import load_from_zip_file

    if not path.is_file():
        raise UsageError(f"there is no policy file '{path}'.")
    try:
        data, _, _ = load_from_zip_file(path, device="cpu", custom_objects=_UNUSED)
    except (ValueError, KeyError, RuntimeError, EOFError, pickle.UnpicklingError) as error:
        raise UsageError(f"'{path}' is not a Stable-Baselines3 policy: {error}") from None
    if data is None or "policy_class" not in data:
        raise UsageError(f"'{path}' is not a Stable-Baselines3 policy.")
    kind = getattr(stable_baselines3, _class_name(data))
    # A policy needs no replay buffer, and must not need what a special one would.
    small = {"replay_buffer_class": None, "buffer_size": 1} if "buffer_size" in data else {}
    try:
        return Learner(kind.load(path, device="cpu", custom_objects=_UNUSED, **small))
    except (ValueError, KeyError, RuntimeError, TypeError, AttributeError) as error:
        raise UsageError(f"'{path}' holds no policy of {kind.__name__}: {error}") from None


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Let PyTorch use this many threads, and set it back.

    On a busy machine a second thread makes a small network fifty times slower: each waits for the
    other at every layer.
    """
    import torch

    before = torch.get_num_threads()
    if before == count:
        yield
        return
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def stack(observations: Sequence[Any]) -> Any:
    """One batch of several observations."""
    first = observations[0]
    if isinstance(first, Mapping):
        return {key: stack([observation[key] for observation in observations]) for key in first}
    return np.stack([np.asarray(observation) for observation in observations])


def _class_name(data: Mapping[str, Any]) -> str:
    """Which algorithm wrote a file; the file itself only says what it holds."""
    return next((name for name, mark in _MARKS.items() if mark in data), "A2C")
