"""Episodes with a known answer, for picture and page."""

from __future__ import annotations

from typing import Any

import numpy as np

from hprs import parse_task
from hprs.explanation.film import Film

TASK = parse_task(
    """
    signal wall in [-1, 4]
    signal lap in [0, 1]
    signal speed in [0, 4] "</script><img src=x onerror=alert(1)>"
    ensure clear: wall >= 0
    conquer finish: lap >= 1
    encourage slow: speed <= 2
    """
)


def trace(steps: int) -> dict[str, Any]:
    """A lap at a speed that swings, with a crash in its last state."""
    along = np.linspace(0.0, 1.0, steps + 1)
    wall = np.where(along < 1.0, 2.0, -0.5)
    return {"wall": wall, "lap": 1.2 * along, "speed": 2.0 + np.sin(7 * along)}


def short_film(steps: int) -> Film:
    """A bar that grows with the steps."""
    film = Film()
    for step in range(steps + 1):
        picture = np.full((40, 60, 3), 230, np.uint8)
        picture[:, : round(60 * step / steps)] = (0, 114, 178)
        film.add(step, picture)
    return film
