"""Tracks for tests, each made once, and places on them."""

from __future__ import annotations

from functools import cache

import jax
import numpy as np

from hprs.carsim.designs import load_track
from hprs.carsim.geometry import inside
from hprs.carsim.random_track import random_track
from hprs.carsim.track import Track, stack_tracks

NAMES = ("gm", "trt", "gm-c", "trt backwards", "random:0", "random:4")


@cache
def track_of(name: str) -> Track:
    if name.startswith("random:"):
        return random_track(int(name.removeprefix("random:")))
    return load_track(name.split()[0], reverse=name.endswith("backwards"))


@cache
def padded(name: str) -> Track:
    """The track in the shape that all of them have in a batch, for which functions compile once."""
    batch = stack_tracks([track_of(each) for each in NAMES])
    return jax.tree.map(lambda leaf: leaf[NAMES.index(name)], batch)


@cache
def walls_of(name: str) -> np.ndarray:
    """The walls with a length, in float64."""
    return np.asarray(track_of(name).walls, float)


@cache
def free_points(name: str, number: int = 400) -> np.ndarray:
    """Drivable points, evenly distributed."""
    walls = walls_of(name)
    generator = np.random.default_rng(1)
    low, high = walls[:, :2].min(axis=0), walls[:, :2].max(axis=0)
    points = generator.uniform(low, high, (20 * number, 2)).astype(np.float32).astype(float)
    return points[inside(points, walls)][:number]
