"""Toy environments with a known answer."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from hprs.spec.expression import Name
from hprs.spec.task import Definition, Requirement, Signal, Source, Task


class Slider(gym.Env[np.ndarray, np.ndarray]):
    """A point on a line that moves by its action, plus noise; reports its lap in `info`."""

    metadata = {"render_modes": []}  # noqa: RUF012

    def __init__(self, horizon: int = 12, own_end: float = 2.5) -> None:
        self.observation_space = spaces.Box(-10.0, 10.0, (2,), np.float64)
        self.action_space = spaces.Box(-1.0, 1.0, (1,), np.float64)
        self.horizon, self.own_end = horizon, own_end
        self.position, self.steps = 0.0, 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        super().reset(seed=seed)
        self.position, self.steps = float(self.np_random.uniform(-0.5, 0.5)), 0
        return self._observe(), {"lap": {"progress": self.position / 2.0}}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        self.position += float(action[0]) + 0.1 * float(self.np_random.uniform(-1, 1))
        self.steps += 1
        ended = abs(self.position) > self.own_end
        info = {"lap": {"progress": self.position / 2.0}, "force": float(action[0]) ** 2}
        return self._observe(), -abs(self.position), ended, self.steps >= self.horizon, info

    def _observe(self) -> np.ndarray:
        return np.array([self.position, self.steps], dtype=np.float64)


def slider_task(kind: str = "achieve") -> Task:
    """Stay on the line, get to the far end, gently; reads observation, actions and info."""
    x = Signal("x", -3.0, 3.0, source=Source("obs", (), 0))
    progress = Signal("progress", -2.0, 2.0, source=Source("info", ("lap", "progress")))
    force = Signal("force", 0.0, 1.0, source=Source("info", ("force",)), initially=0.0)
    push = Signal("push", -1.0, 1.0, source=Source("action", (), 0))
    before = Signal("before", -1.0, 1.0, source=Source("last_action", (), 0))
    change = Definition("change", abs(push - before))
    return Task(
        signals=(x, progress, force, push, before),
        definitions=(change,),
        requirements=(
            Requirement("encourage", "smooth", Name("change") <= 0.5),
            Requirement("ensure", "on_line", (x >= -1.5) & (x <= 2.0)),
            Requirement(kind, "there", progress >= 0.7),  # type: ignore[arg-type]
            Requirement("encourage", "gentle", force < 0.25),
        ),
    )
