"""Random tracks: any seed gives one that a car can drive."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from hprs.carsim.construction import walls_beside
from hprs.carsim.designs import Design, corridor, trace
from hprs.carsim.geometry import Points, curvature, resample
from hprs.carsim.track import POINTS, Track
from hprs.errors import TrackError

SMALLEST_RADIUS = 1.3
"""Smallest radius of a random centre line in m."""
_LENGTHS = (16.0, 45.0)
_WIDTHS = (1.3, 1.9)
_BEND_LENGTH = 3.2
"""Length of the centre line for each control point, in m."""


def random_track(seed: int, *, reverse: bool = False, dtype: npt.DTypeLike | None = None) -> Track:
    """The track of a seed: 16 m to 45 m long and 1.2 m to 2 m wide."""
    generator = np.random.default_rng(seed)
    length = generator.uniform(*_LENGTHS)
    number = round(length / _BEND_LENGTH)
    angles = (np.arange(number) + generator.uniform(-0.3, 0.3, number)) * (2 * np.pi / number)
    radii = generator.uniform(-1, 1, number)
    width = generator.uniform(*_WIDTHS) + generator.uniform(-0.1, 0.1, number)
    roughness = 0.75
    while True:
        spread = 1 + roughness * radii
        points = np.stack([spread * np.cos(angles), spread * np.sin(angles), width], axis=1)
        design = Design(length=length, start=0.0, points=tuple(map(tuple, points.tolist())))
        centre, widths = trace(design)
        if _drivable(centre, widths):
            return corridor(centre, widths / 2, name=f"random:{seed}", reverse=reverse, dtype=dtype)
        # Less uneven radii and angles end at a circle, which is always good.
        roughness *= 0.9
        even = np.arange(number) * (2 * np.pi / number)
        angles = even + 0.9 * (angles - even)


def _drivable(centre: Points, widths: Points) -> bool:
    # The bend of a polyline is noisy from point to point: a quarter of the points smooth it.
    (coarse,) = resample(centre, POINTS // 4)
    if np.abs(curvature(coarse)).max() > 1 / SMALLEST_RADIUS:
        return False
    try:
        walls_beside(centre, widths / 2, widths / 2, name="random")
    except TrackError:
        return False
    return True
