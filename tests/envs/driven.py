"""What tests of the driving benchmarks share: each thing that takes seconds to compile, once."""

from __future__ import annotations

from functools import cache

import gymnasium as gym
import jax
import numpy as np

from hprs.carsim.actuators import MAX_SPEED_COMMAND
from hprs.carsim.drivers import pursue
from hprs.carsim.lidar import BEAMS
from hprs.carsim.selection import selected
from hprs.envs import functional
from hprs.envs.driving.simulation import SPEED_CHANGE

SAFE, FOLLOW = "hprs/SafeDriving-v0", "hprs/FollowLeader-v0"
IDS = [SAFE, FOLLOW]

reset = jax.jit(lambda simulation, key: simulation.reset(jax.random.wrap_key_data(key)))
step = jax.jit(lambda simulation, episode, action: simulation.step(episode, action))


@cache
def simulation_of(name):
    return functional.make(name)


def key_of(seed):
    """The key that an environment draws at `reset(seed=seed)`."""
    return np.random.default_rng(seed).integers(0, 2**32, 2, np.uint32)


@jax.jit
def _pursued(simulation, episode):
    track = selected(simulation.tracks, episode.track)
    car = jax.tree.map(lambda leaf: leaf[0], episode.world.cars)
    command = pursue(car, episode.world.progress[0], track)
    return command.steering, command.speed


def pilot(simulation, episode):
    """The action of the driver that pursues the centre line."""
    steering, speed = _pursued(simulation, episode)
    now = (episode.commands[-1, 1] + 1) / 2 * MAX_SPEED_COMMAND
    return np.clip([(speed - now) / SPEED_CHANGE, steering], -1, 1).astype(np.float32)


@cache
def driven(name, seed, steps=100):
    """Actions of the pilot from a seed on, and what the pure functions answer: up to an end."""
    simulation = simulation_of(name)
    episode, observation, signals = reset(simulation, key_of(seed))
    actions, answers = [], [(observation, signals, 0.0, False, False)]
    for _ in range(steps):
        actions.append(pilot(simulation, episode))
        episode, *answer = step(simulation, episode, actions[-1])
        answers.append(tuple(answer))
        if answer[3] or answer[4]:
            break
    answers = jax.tree.map(np.asarray, answers)
    for answer in answers:
        answer[1].update({name: float(value) for name, value in answer[1].items()})
    return actions, answers


@cache
def shared(name):
    """One environment without a time limit."""
    return gym.make(name).unwrapped


def assert_observed(found, expected):
    """Both are the same observation, to 1e-5.

    Compiled in another way, the same numbers are rounded in another way. A beam that grazes a wall
    multiplies what that does to the pose: it may differ by a tenth of what its neighbours do.
    """
    found, expected = np.asarray(found), np.asarray(expected)
    tolerance = np.full(expected.shape, 1e-5)
    stacked = (len(expected) - 6) // (BEAMS + 1)
    scans = slice(6, 6 + stacked * BEAMS)
    apart = np.abs(np.diff(expected[scans].reshape(stacked, BEAMS)))
    ends = [(0, 0), (1, 0)], [(0, 0), (0, 1)]
    tolerance[scans] += 0.1 * np.maximum(*(np.pad(apart, end) for end in ends)).ravel()
    assert (np.abs(found - expected) <= tolerance).all(), np.abs(found - expected).max()
