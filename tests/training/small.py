"""Trainings of a second, and what the tests ask of them."""

from __future__ import annotations

import os
import signal
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from hprs.training import sb3
from hprs.training.configuration import Configuration
from hprs.training.configure import configure
from hprs.training.listener import Silence
from hprs.training.run_directory import RunDirectory
from hprs.training.trained import load_policy
from tests.training.ppo.point import ID, TASK

CART_POLE = "hprs/CartPole-v0"

MOUNTAIN = """
signal position = obs[0] in [-1.2, 0.6] "m"
signal velocity = obs[1] in [-0.07, 0.07]
achieve top: position >= 0.45
encourage gentle: abs(velocity) <= 0.05
"""


configure_sb3 = partial(configure, trainer="sb3")
"""A configuration of a training with Stable-Baselines3."""


def ppo(environment: str = CART_POLE, settings: Any = None, **options: Any) -> Configuration:
    """Three environments, scaled rewards, an evaluation a rollout."""
    small = {"environments": 3, "n_steps": 32, "batch_size": 32, "n_epochs": 2, "net_arch": [8]}
    return configure_sb3(
        environment,
        algorithm="ppo",
        settings={**small, "scale_reward": True, **(settings or {})},
        **{"steps": 480, "evaluation_interval": 96, "evaluation_episodes": 2, **options},
    )


def off_policy(
    folder: Path, algorithm: str = "sac", settings: Any = None, **options: Any
) -> Configuration:
    """Two environments, scaled rewards, a buffer that is shorter than the training."""
    task = folder / "mountain.hprs"
    task.write_text(MOUNTAIN)
    small = {"environments": 2, "learning_starts": 40, "buffer_size": 150, "batch_size": 16}
    return configure_sb3(
        "MountainCarContinuous-v0",
        task_path=str(task),
        algorithm=algorithm,
        settings={**small, "net_arch": [8], "scale_reward": True, **(settings or {})},
        **{
            "horizon": 25,
            "steps": 240,
            "evaluation_interval": 60,
            "evaluation_episodes": 2,
            **options,
        },
    )


def jax_ppo(folder: Path, *, device: bool) -> Configuration:
    """Four environments, an evaluation every other rollout."""
    small = {"environments": 4, "n_steps": 8, "batch_size": 16, "n_epochs": 2, "net_arch": [8]}
    return _jax(folder, "ppo", small, device=device)


def jax_sac(folder: Path, *, device: bool) -> Configuration:
    """Two environments, a buffer that is shorter than the training."""
    small = {"environments": 2, "learning_starts": 40, "buffer_size": 150, "batch_size": 16}
    return _jax(folder, "sac", {**small, "net_arch": [8], "gradient_steps": 2}, device=device)


def _jax(folder: Path, algorithm: str, settings: Any, *, device: bool) -> Configuration:
    task = folder / "task.hprs"
    task.write_text(TASK if device else MOUNTAIN)
    return configure(
        ID if device else "MountainCarContinuous-v0",
        task_path=str(task),
        algorithm=algorithm,
        settings=settings,
        horizon=25,
        steps=384,
        evaluation_interval=64,
        evaluation_episodes=2,
    )


class Interrupter(Silence):
    """Sends a signal after a number of steps, as Ctrl-C would."""

    def __init__(self, step: int, number: signal.Signals = signal.SIGINT) -> None:
        self.step, self.number = step, number
        self.asked = 0
        self.heard: list[str] = []

    def advanced(self, step: int) -> None:
        if step >= self.step and not self.asked:
            os.kill(os.getpid(), self.number)

    def stopping(self) -> None:
        self.asked += 1

    def noticed(self, text: str) -> None:
        self.heard.append(text)


class Killer(Silence):
    """Dies after a number of steps, and saves nothing."""

    def __init__(self, step: int) -> None:
        self.step = step

    def advanced(self, step: int) -> None:
        if step >= self.step:
            raise MemoryError


def table(run: RunDirectory) -> str:
    """The text of its evaluations."""
    return (run.path / "evaluations.csv").read_text()


def same_numbers(one: RunDirectory, two: RunDirectory) -> bool:
    """Whether tables and final weights of two runs are equal bit for bit."""
    weights = [_weights(run) for run in (one, two)]
    return table(one) == table(two) and all(
        np.array_equal(*pair) for pair in zip(*weights, strict=True)
    )


def _weights(run: RunDirectory) -> list[Any]:
    if run.configuration.trainer == "jax":
        policy: Any = load_policy(run, "last")
        return [array for layer in policy.layers for array in layer]
    return list(sb3.load_policy(run, "last").model.policy.state_dict().values())
