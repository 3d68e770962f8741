"""A scripted pilot of the lander: `--policy hprs.envs.lunar_lander.pilot:fly`.

A reference, not a learner's rival: it meets the task, so that the task is known to be possible.
"""

from __future__ import annotations

from typing import Any

import numpy as np

CLEARANCE = 0.2
"""Horizontal distance of the lander's centre from an edge that it passes; its legs reach 0.12."""
HEADROOM = 0.25
"""Height above the obstacle at which the lander waits until it can pass."""
LOW = 0.1
"""Height at which it waits until it is above the pad."""


def fly(observation: Any) -> np.ndarray:
    """Pass the obstacle on the nearer side, then go to the pad; switch off on two legs.

    Args:
        observation: Of `LunarLanderObstacle`; nothing else is remembered.

    Returns:
        The main and the lateral engine.
    """
    x, y, vx, vy, angle, spin, leg, other_leg = observation[:8]
    left, right, top, bottom = observation[8:12]
    if leg and other_leg:
        return np.zeros(2, np.float32)
    beside = left - CLEARANCE if abs(x - left) < abs(x - right) else right + CLEARANCE
    is_above = y > bottom - 0.1
    x_wanted = float(beside) if is_above else 0.0
    is_clear = not left - 0.15 < x < right + 0.15
    floor = 0.0
    if is_above and not is_clear:
        floor = top + HEADROOM
    elif not is_above and abs(x) > 0.1 and not (leg or other_leg):
        floor = LOW
    # The ground needs a soft touch, and a height to wait at is approached slowly.
    sinking = np.clip(0.35 * (y - floor), 0.08, 0.35)
    vy_wanted = 0.3 * (floor - y) if floor > 0 and y < floor + 0.1 else -sinking
    angle_wanted = np.clip(x - x_wanted + vx, -0.4, 0.4)
    main = 8.0 * (vy_wanted - vy)
    lateral = 12.0 * (angle - angle_wanted) + 20.0 * spin
    return np.clip([main, lateral], -1.0, 1.0).astype(np.float32)
