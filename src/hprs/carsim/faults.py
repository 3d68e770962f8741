"""Faults of sensors that no training has unless it asks for them: lost scans, a speed that is off.

`FAULTS` is the one table. Worlds without `Faults` neither draw nor compute anything for them, so
that their episodes are what they were before there were any.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
from jax import Array


@dataclass(frozen=True)
class Fault:
    """A row of the table."""

    name: str
    """A field of `Faults`."""
    unit: str
    neutral: float
    """The value that changes nothing."""
    least: float
    greatest: float
    """Ends of what is meaningful."""
    tested: tuple[float, ...]
    """Values under which a policy is tested, ascending."""


# fmt: off
FAULTS = (
    Fault("dropped_scans", "share", 0.0, 0.0, 1.0, (0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9)),
    Fault("speed_scale", "1", 1.0, 0.0, 10.0, (0.5, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.5)),
    Fault("speed_offset", "m/s", 0.0, -10.0, 10.0, (-1.0, -0.5, -0.25, 0.0, 0.25, 0.5, 1.0)),
)
# fmt: on
"""What can be wrong with the sensors of car 0."""


@partial(
    jax.tree_util.register_dataclass,
    data_fields=["dropped_scans", "speed_scale", "speed_offset"],
    meta_fields=[],
)
@dataclass(frozen=True)
class Faults:
    """What is wrong with the sensors of car 0."""

    dropped_scans: Array | float = 0.0
    """Probability that a scan is lost, and the one before stays. The first one is never lost."""
    speed_scale: Array | float = 1.0
    """Factor of the measured speed, its noise included."""
    speed_offset: Array | float = 0.0
    """Added to it, m/s."""


def faulty_scan(scan: Array, before: Array, *, uniform: Array, faults: Faults) -> Array:
    """The scan that arrives.

    Args:
        scan: What the lidar has measured, (beams,), m.
        before: What arrived last, (beams,), m.
        uniform: A number in [0, 1).
        faults: Of the sensors.
    """
    return jnp.where(uniform < jnp.asarray(faults.dropped_scans), before, scan)


def faulty_speed(velocity: Array, faults: Faults) -> Array:
    """The speed that arrives, m/s."""
    return faults.speed_scale * velocity + faults.speed_offset
