"""Gymnasium's bipedal walker with a goal; 0.02 s a step, 1 world unit is 30 pixels."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.utils import EzPickle

from hprs.envs.box2d import Box2D, bipedal_walker
from hprs.envs.options import number, switch
from hprs.errors import UsageError

START = bipedal_walker.TERRAIN_STEP * bipedal_walker.TERRAIN_STARTPAD / 2
"""The hull's x at the start, in world units."""
FIELD_END = bipedal_walker.TERRAIN_STEP * (
    bipedal_walker.TERRAIN_LENGTH - bipedal_walker.TERRAIN_GRASS
)
"""The hull's x at which Gymnasium ends an episode, in world units."""


class BipedalWalker(bipedal_walker.BipedalWalker):
    """The walker, and a goal that ends the episode.

    `info["signals"]` holds `progress`, the hull's x as a fraction of the goal's, and
    `hull_contact`, 1 if the hull has touched anything, else 0.

    Args:
        render_mode: Gymnasium's: `human`, `rgb_array` or None.
        hardcore: Stumps, pits and stairs in the way.
        goal: The hull's x at the goal, in world units.

    Raises:
        UsageError: The goal does not lie between the start and the end of the field, or an option
            is of the wrong kind.
    """

    # Gymnasium declares it as optional; after `reset` it is there.
    hull: Any

    def __init__(
        self, render_mode: str | None = None, *, hardcore: bool = False, goal: float = 27.7
    ) -> None:
        super().__init__(render_mode, switch("hardcore", hardcore))
        # Unpickling calls the constructor with these; Gymnasium has noted its own arguments.
        EzPickle.__init__(self, render_mode, hardcore=hardcore, goal=goal)
        self.goal = number("goal", goal)
        if not START < self.goal <= FIELD_END:
            raise UsageError(
                f"goal must lie beyond the start at {START:.2f} and at most at the end of the "
                f"field, {FIELD_END:.2f}, got {goal}."
            )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start an episode: new terrain, and one frame without torque."""
        # A world remembers bodies that are gone: the next episode would depend on the last one.
        self._destroy()
        self.world = Box2D.b2World()
        observation, info = super().reset(seed=seed, options=options)
        return observation, {**info, "signals": self._signals()}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Play one frame."""
        observation, reward, terminated, _, info = super().step(action)
        signals = self._signals()
        reached = signals["progress"] >= 1.0
        return (
            observation,
            float(reward),
            terminated or reached,
            False,
            {**info, "signals": signals},
        )

    def _signals(self) -> dict[str, float]:
        return {
            "progress": self.hull.position.x / self.goal,
            "hull_contact": 1.0 if self.game_over else 0.0,
        }
