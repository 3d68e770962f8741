"""A track of any size, for measurements on large maps."""

from __future__ import annotations

import numpy as np

from hprs.carsim.designs import corridor
from hprs.carsim.track import POINTS, Track


def flower(radius: float) -> Track:
    """A corridor that winds around a circle; radius in m."""
    angle = np.linspace(0, 2 * np.pi, POINTS, endpoint=False)
    distance = radius + 0.07 * radius * np.sin(round(0.35 * radius) * angle)
    centre = distance[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return corridor(centre, np.full(POINTS, 0.75), name=f"flower of {radius:g} m")
