"""A policy for the driving benchmarks that knows the track: pure pursuit of the centre line.

It reads the state of its environment, so that it can be filmed but not deployed.
"""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

from hprs.carsim.actuators import MAX_SPEED_COMMAND
from hprs.carsim.drivers import PursuitParameters, pursue
from hprs.carsim.selection import selected
from hprs.carsim.track import Track
from hprs.envs.driving.simulation import SPEED_CHANGE, Episode
from hprs.envs.driving.single import DrivingEnv
from hprs.errors import UsageError

HEADWAY = 1.75
"""Distance that it keeps from a leader along the track, m: the middle of the comfortable ones."""
_EAGERNESS = 1.5
"""Speed in m/s that it adds for a metre too much."""
_HURRIED = 3.5
"""Lateral acceleration that it allows behind a leader, m/s^2: leaders are fast in bends."""


class Pursuit:
    """Drives an environment's car, at a leader's speed where there is one.

    Args:
        environment: A driving benchmark, wrapped or not.
    """

    def __init__(self, environment: Any) -> None:
        self._environment = environment.unwrapped
        if not isinstance(self._environment, DrivingEnv):
            raise UsageError("the policy 'pursuit' drives hprs/SafeDriving-v0 and FollowLeader-v0.")

    def __call__(self, observation: Any) -> Any:
        """The action to take; it reads the state instead of the observation."""
        episode = self._environment.episode
        steering, speed = map(float, _pursued(self._environment.simulation.tracks, episode))
        world = episode.world
        if len(world.distance) == 2:
            behind = world.gap + world.distance[1] - world.distance[0]
            leader = float(world.cars.speed[1]) / PursuitParameters.speed_gain
            speed = min(speed, max(leader + _EAGERNESS * float(behind - HEADWAY), 0.0))
        now = (episode.commands[-1, 1] + 1) / 2 * MAX_SPEED_COMMAND
        action = np.array([(speed - now) / SPEED_CHANGE, steering])
        return np.clip(action, -1, 1).astype(np.float32)


@jax.jit
def _pursued(tracks: Track, episode: Episode) -> tuple[Any, Any]:
    track = selected(tracks, episode.track)
    car = jax.tree.map(lambda leaf: leaf[0], episode.world.cars)
    alone = len(episode.world.distance) == 1
    driver = PursuitParameters() if alone else PursuitParameters(lateral_acceleration=_HURRIED)
    command = pursue(car, episode.world.progress[0], track, parameters=driver)
    return command.steering, command.speed
