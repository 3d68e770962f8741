"""Draws the running episode of one environment; it reads states and changes none."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hprs.envs.driving.layout import episode_layout
from hprs.envs.driving.rendering.ground import ground_of
from hprs.envs.driving.rendering.picture import Painter
from hprs.envs.driving.rendering.scene import scene_of
from hprs.envs.driving.simulation import Episode, Simulation
from hprs.errors import UsageError

TRAIL = 25
"""States that a trail holds; ten are a second."""


class Drawing:
    """What has been seen of an episode, and pictures of it.

    Args:
        simulation: Of the environment.
        camera: `fixed` or `follow`.
    """

    def __init__(self, simulation: Simulation, camera: str) -> None:
        self._simulation, self._camera = simulation, camera
        # Reading a state costs more than a step: only what is drawn is read, and once.
        self._unread: deque[NDArray[np.uint32]] = deque(maxlen=TRAIL)
        self._states: deque[Episode] = deque(maxlen=TRAIL)
        self._painters: dict[int, Painter] = {}

    def restart(self) -> None:
        """Forget the last episode."""
        self._unread.clear()
        self._states.clear()

    def see(self, packed: NDArray[np.uint32]) -> None:
        """Take a state into the trail."""
        # The memory of a state that was handed to JAX may be used again.
        self._unread.append(packed.copy())

    def picture(self) -> NDArray[np.uint8]:
        """The newest state, (height, width, 3).

        Raises:
            UsageError: There is none yet.
        """
        if not (self._states or self._unread):
            raise UsageError("render() was called before reset().")
        layout = episode_layout(self._simulation)
        while self._unread:
            self._states.append(layout.read(self._unread.popleft()))
        index = int(self._states[-1].track)
        if index not in self._painters:
            ground = ground_of(self._simulation.tracks, index)
            self._painters[index] = Painter(ground, self._camera)
        painter = self._painters[index]
        reach = self._simulation.settings.lidar.reach
        return painter.paint(scene_of(self._states, length=painter.ground.length, reach=reach))

    def __getstate__(self) -> dict[str, Any]:
        # Pens cannot be copied; what paints is made again.
        return {**self.__dict__, "_painters": {}}
