"""Gymnasium's continuous lander with an obstacle above its pad; 0.02 s a step, unlimited fuel.

Coordinates are those of Gymnasium's observation: (0, 0) is the lander's centre when it stands on
the pad, x = 1 lies 10 world units to the right, y = 1 lies 6.67 world units up.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.utils import EzPickle

from hprs.envs.box2d import Box2D, lunar_lander
from hprs.envs.options import edges, number
from hprs.errors import UsageError

HALF_WIDTH = lunar_lander.VIEWPORT_W / lunar_lander.SCALE / 2
"""World units of x = 1."""
HALF_HEIGHT = lunar_lander.VIEWPORT_H / lunar_lander.SCALE / 2
"""World units of y = 1."""
EDGE_LIMIT = 2.5
"""Farthest edge of an obstacle; Gymnasium's own bound of a position."""
START_REACH = 0.12
"""How far a lander's legs reach beyond the x that it starts from, in its first frame."""
START_HEIGHTS = (1.31, 1.52)
"""What its legs and its body take up of the height there."""
RED = (204, 41, 41), (128, 20, 20)
"""Colours of the obstacle's face and rim."""


class LunarLanderObstacle(lunar_lander.LunarLander):
    """The lander, the obstacle, and episodes that a landing does not end.

    The observation is Gymnasium's (8 values), the obstacle's left, right, top and bottom edge, and
    1 if the lander's body has touched anything, else 0.

    Args:
        render_mode: Gymnasium's: `human`, `rgb_array` or None.
        obstacle: Left and right edge.
        obstacle_heights: Bottom and top edge.
        x_offset: The lander starts at an x drawn uniformly from +-x_offset.

    Raises:
        UsageError: The obstacle has no area, lies outside the world or where the lander starts, or
            the offset does not lie in [0, 1).
    """

    # Gymnasium declares these as optional or as any space; after `reset` they are what they are.
    observation_space: Any
    lander: Any
    prev_shaping: Any

    def __init__(
        self,
        render_mode: str | None = None,
        *,
        obstacle: tuple[float, float] = (0.0, 0.2),
        obstacle_heights: tuple[float, float] = (0.46, 0.53),
        x_offset: float = 0.1,
    ) -> None:
        super().__init__(render_mode, continuous=True)
        # Unpickling calls the constructor with these; Gymnasium has noted its own arguments.
        EzPickle.__init__(
            self,
            render_mode,
            obstacle=obstacle,
            obstacle_heights=obstacle_heights,
            x_offset=x_offset,
        )
        self.left, self.right = edges("obstacle", obstacle, EDGE_LIMIT)
        self.bottom, self.top = edges("obstacle_heights", obstacle_heights, EDGE_LIMIT)
        self.x_offset = number("x_offset", x_offset)
        if not 0 <= self.x_offset < 1:
            raise UsageError(f"x_offset must lie in [0, 1), got {x_offset}.")
        reach = self.x_offset + START_REACH
        _refuse_at_start(self.left, self.right, self.bottom, self.top, reach)
        own = self.observation_space
        self.observation_space = spaces.Box(
            np.append(own.low, [-EDGE_LIMIT] * 4 + [0]).astype(np.float32),
            np.append(own.high, [EDGE_LIMIT] * 4 + [1]).astype(np.float32),
        )
        self._observation = np.zeros(13, np.float32)
        self._observation[8:12] = self.left, self.right, self.top, self.bottom
        self._scene_is_complete = True
        self._has_rested = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start an episode: new terrain, a new start, and one frame without thrust."""
        self._scene_is_complete = False
        self._has_rested = False
        return super().reset(seed=seed, options=options)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Play one frame."""
        # Gymnasium's reset builds the scene and then plays a frame, which is the first moment at
        # which the scene can be changed.
        if not self._scene_is_complete:
            self._complete_scene()
        shaping_before = self.prev_shaping
        own, reward, terminated, _, info = super().step(action)
        if not self.lander.awake:
            # Gymnasium ends the episode here. "Conquer" is decided at the horizon, so this lander
            # stays, and is paid for coming to rest once.
            terminated = self.game_over
            if self._has_rested:
                reward = self.prev_shaping - shaping_before
            self._has_rested = True
        observation = self._observation.copy()
        observation[:8] = own
        observation[12] = self.game_over
        return observation, float(reward), terminated, False, info

    def render(self) -> Any:
        """Draw the scene; Gymnasium's reset asks for it before the scene is complete."""
        return super().render() if self._scene_is_complete else None

    def _complete_scene(self) -> None:
        """Move the lander to its start, and put the obstacle there."""
        self._scene_is_complete = True
        if self.x_offset > 0:
            shift = float(self.np_random.uniform(-self.x_offset, self.x_offset)) * HALF_WIDTH
            for body in (self.lander, *self.legs):
                body.position = (body.position.x + shift, body.position.y)
        origin = self.helipad_y + lunar_lander.LEG_DOWN / lunar_lander.SCALE
        obstacle = self.world.CreateStaticBody(
            position=(
                HALF_WIDTH * (1 + (self.left + self.right) / 2),
                origin + HALF_HEIGHT * (self.bottom + self.top) / 2,
            ),
            shapes=Box2D.b2PolygonShape(
                box=(
                    HALF_WIDTH * (self.right - self.left) / 2,
                    HALF_HEIGHT * (self.top - self.bottom) / 2,
                )
            ),
        )
        obstacle.color1, obstacle.color2 = RED
        self.drawlist.append(obstacle)


def _refuse_at_start(left: float, right: float, bottom: float, top: float, reach: float) -> None:
    if left <= reach and right >= -reach and bottom <= START_HEIGHTS[1] and top >= START_HEIGHTS[0]:
        raise UsageError(
            f"the obstacle reaches where the lander starts, x in +-{reach:.2f} and y in "
            f"{list(START_HEIGHTS)}: the episode would start with a collision."
        )
