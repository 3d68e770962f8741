"""A policy for the driving benchmarks that knows the track: pure pursuit of the centre line.

It reads the state of its environment, so that it can be filmed but not deployed.
"""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

from hprs.carsim.actuators import MAX_SPEED_COMMAND
from hprs.carsim.drivers import follow, pursue
from hprs.carsim.race import lead_distance
from hprs.carsim.selection import selected
from hprs.carsim.track import Track
from hprs.envs.driving.simulation import SPEED_CHANGE, Episode
from hprs.envs.driving.single import DrivingEnv
from hprs.errors import UsageError


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
        steering, speed = map(float, _driven(self._environment.simulation.tracks, episode))
        now = (episode.commands[-1, 1] + 1) / 2 * MAX_SPEED_COMMAND
        action = np.array([(speed - now) / SPEED_CHANGE, steering])
        return np.clip(action, -1, 1).astype(np.float32)


@jax.jit
def _driven(tracks: Track, episode: Episode) -> tuple[Any, Any]:
    world = episode.world
    track, s = selected(tracks, episode.track), world.progress[0]
    car, other = (jax.tree.map(lambda leaf, i=i: leaf[i], world.cars) for i in (0, -1))
    if len(world.distance) == 1:
        command = pursue(car, s, track)
    else:
        behind = -lead_distance(world)
        command = follow(car, s, track, behind=behind, leader_speed=other.speed)
    return command.steering, command.speed
