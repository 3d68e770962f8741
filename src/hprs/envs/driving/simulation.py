"""A car that learns to drive, as pure functions of one episode: 10 control steps a second.

An action changes the speed command and sets the steering command. The commands, not the changes,
are what the policy remembers and what smoothness is about.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from hprs.carsim import race
from hprs.carsim.actuators import MAX_SPEED_COMMAND, Command
from hprs.carsim.selection import selected
from hprs.carsim.track import SIGHT, Track

SPEED_CHANGE = 0.4
"""Change of the speed command by an action of 1, m/s: 4 m/s^2 at 10 Hz."""
REMEMBERED_COMMANDS = 3
"""Commands in an observation, the newest included."""
SPEED_SCALE = 5.0
"""Speed in m/s that is observed as 1; what the strongest motor reaches."""
SIGNALS = (
    "progress",
    "collision",
    "clearance",
    "speed",
    "steering",
    "speed_command",
    "last_steering",
    "last_speed_command",
)
"""Signals of one car."""
LEADER_SIGNALS = ("lead_distance", "leader_contact")
"""What a leader adds to them."""

Signals: TypeAlias = dict[str, Array]
"""Signal to value, all of them scalars; the values of the task's text."""


@partial(
    jax.tree_util.register_dataclass,
    data_fields=["world", "track", "commands", "scans", "speeds"],
    meta_fields=[],
)
@dataclass(frozen=True)
class Episode:
    """State of one running episode."""

    world: race.World
    """The cars."""
    track: Array
    """Number of the track, () int32."""
    commands: Array
    """The last commands as (steering, speed), both in [-1, 1], oldest first,
    (REMEMBERED_COMMANDS, 2); a speed of -1 is to stand, as before the first action."""
    scans: Array
    """The last lidar readings, oldest first, (stacked, beams), m."""
    speeds: Array
    """The last measured forward speeds, oldest first, (stacked,), m/s."""


@partial(
    jax.tree_util.register_dataclass,
    data_fields=["tracks", "settings", "horizon"],
    meta_fields=["stacked"],
)
@dataclass(frozen=True)
class Simulation:
    """What all episodes share; arrays are arguments of compiled functions, not constants."""

    tracks: Track
    """A stack; each episode draws one."""
    settings: race.Settings
    """Of the worlds."""
    horizon: Array
    """Control steps after which an episode is truncated, () int32."""
    stacked: int = 1
    """Scans and speeds in an observation."""

    @property
    def beams(self) -> int:
        """Readings in a scan."""
        return self.settings.lidar.beams

    @property
    def signal_names(self) -> tuple[str, ...]:
        """Signals in the order in which they are reported."""
        return SIGNALS + LEADER_SIGNALS * (self.settings.cars - 1)

    @property
    def observation_size(self) -> int:
        """Length of an observation."""
        return 2 * REMEMBERED_COMMANDS + self.stacked * (self.beams + 1)

    @property
    def history(self) -> tuple[np.ndarray, np.ndarray]:
        """Which components of an observation repeat what earlier ones have shown.

        Returns:
            Of every component the one whose past it is, and how many steps old; in the first steps
            of an episode it is that of the first observation.
        """
        parts = ((REMEMBERED_COMMANDS, 2), (self.stacked, self.beams), (self.stacked, 1))
        repeats: list[np.ndarray] = []
        lags: list[np.ndarray] = []
        start = 0
        for length, width in parts:
            newest = start + (length - 1) * width + np.arange(width)
            repeats.append(np.tile(newest, length))
            lags.append(np.repeat(np.arange(length)[::-1], width))
            start += length * width
        return np.concatenate(repeats), np.concatenate(lags)

    def reset(self, key: Array, track: Array | None = None) -> tuple[Episode, Array, Signals]:
        """A new episode, its first observation and its signals.

        Args:
            key: JAX key; it determines all that is drawn in the episode.
            track: Number of the track, () int32; None draws it.
        """
        track_key, world_key = jax.random.split(key)
        count = self.tracks.length.shape[0]
        index = jax.random.randint(track_key, (), 0, count, jnp.int32) if track is None else track
        driven = selected(self.tracks, index)
        world = race.reset(world_key, driven, self.settings)
        dtype = driven.centre.dtype
        standing = jnp.tile(jnp.array([0.0, -1.0], dtype), (REMEMBERED_COMMANDS, 1))
        episode = Episode(
            world=world,
            track=index,
            commands=standing,
            scans=jnp.tile(world.scan, (self.stacked, 1)),
            speeds=jnp.tile(world.velocity, self.stacked),
        )
        return episode, observe(episode), self._signals(episode, driven)

    def step(
        self, episode: Episode, action: Array
    ) -> tuple[Episode, Array, Signals, Array, Array, Array]:
        """One control step.

        Args:
            episode: The state.
            action: Change of speed and steering, (2,); clipped to [-1, 1], positive to the left.

        Returns:
            The new state, the observation, the signals, the environment's own reward (100 times
            the fraction of a lap that was driven), and whether the episode has terminated (by a
            contact or a lap) or is truncated.
        """
        track = selected(self.tracks, episode.track)
        change, steering = jnp.clip(action.astype(episode.commands.dtype), -1.0, 1.0)
        standing = episode.commands[-1, 1]
        speed = jnp.clip(standing + 2 * SPEED_CHANGE / MAX_SPEED_COMMAND * change, -1.0, 1.0)
        command = Command(steering, (speed + 1) / 2 * MAX_SPEED_COMMAND)
        before = episode.world
        settings = self.settings
        world = race.step(before, track, command, lidar=settings.lidar, faults=settings.faults)
        episode = replace(
            episode,
            world=world,
            commands=_pushed(episode.commands, jnp.stack([steering, speed])),
            scans=_pushed(episode.scans, world.scan),
            speeds=_pushed(episode.speeds, world.velocity),
        )
        signals = self._signals(episode, track)
        driven = world.distance[0] - before.distance[0]
        reward = 100 * driven / track.length
        contact = world.hit_wall[0] | world.hit_car
        terminated = contact | (signals["progress"] >= 1)
        return (
            episode,
            observe(episode),
            signals,
            reward,
            terminated,
            ~terminated & (world.steps >= self.horizon),
        )

    def _signals(self, episode: Episode, track: Track) -> Signals:
        world = episode.world
        last, now = episode.commands[-2], episode.commands[-1]
        values = (
            world.distance[0] / track.length,
            world.hit_wall[0].astype(now.dtype),
            race.clearance(world, track)[0],
            (world.cars.speed * jnp.cos(world.cars.slip))[0],
            now[0],
            now[1],
            last[0],
            last[1],
        )
        if self.settings.cars == 2:
            values += (race.lead_distance(world), world.hit_car.astype(now.dtype))
        return dict(zip(self.signal_names, values, strict=True))


def observe(episode: Episode) -> Array:
    """What the policy sees, in [-1, 1]: commands, scans and speeds, each oldest first.

    Readings of 0 to 15 m and speeds of 0 to 5 m/s are mapped to [-1, 1].
    """
    scans = 2 * episode.scans / SIGHT - 1
    speeds = 2 * episode.speeds / SPEED_SCALE - 1
    parts = (episode.commands.ravel(), scans.ravel(), speeds)
    return jnp.clip(jnp.concatenate(parts), -1.0, 1.0)


def _pushed(history: Array, newest: Array) -> Array:
    return jnp.concatenate([history[1:], newest[None]])
