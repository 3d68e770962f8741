"""Follow-the-gap: the driver of the leading car, a function of one lidar scan."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
from jax import Array

from hprs.carsim.actuators import MAX_SPEED_COMMAND, STEERING_SCALE, Command

BASE_SPEED = (1.25, 1.75)
"""Range of the base speed in m/s, drawn for each episode (the paper's table)."""
VARIABLE_SPEED = (0.25, 0.75)
"""Range in m/s of what is added on the straight, drawn for each episode (the paper's code)."""
GAP_THRESHOLD = 1.5
"""Distance in m beyond which a beam is part of a gap: the value of the paper's code on GM-C."""


@partial(
    jax.tree_util.register_dataclass,
    data_fields=["base_speed", "variable_speed", "threshold"],
    meta_fields=[],
)
@dataclass(frozen=True)
class LeaderParameters:
    """How a leader drives."""

    base_speed: Array | float
    """m/s."""
    variable_speed: Array | float
    """m/s."""
    threshold: Array | float = GAP_THRESHOLD
    """m."""


def sample_leader(key: Array, *, threshold: Array | float = GAP_THRESHOLD) -> LeaderParameters:
    """A leader with random speeds.

    Args:
        key: JAX key.
        threshold: Of gaps, m.
    """
    low, high = jnp.array([BASE_SPEED, VARIABLE_SPEED], jnp.float32).T
    base, variable = low + (high - low) * jax.random.uniform(key, (2,), jnp.float32)
    return LeaderParameters(base, variable, jnp.asarray(threshold, jnp.float32))


def follow_the_gap(scan: Array, angles: Array, *, parameters: LeaderParameters) -> Command:
    """Steer to the middle of the widest gap, slower the more it steers.

    Without a gap it drives straight on at its base speed. The paper's code works on readings that
    are 0.25 m too long; ours are not, so that the same threshold asks for 0.25 m more space.

    Args:
        scan: Distances in m, (B,).
        angles: Of the beams, rad, equally spaced, positive to the left, (B,).
        parameters: Of the leader.
    """
    first, last, is_gap = widest_run(scan > parameters.threshold)
    middle = (angles[first] + angles[last]) / 2
    angle = jnp.where(is_gap, jnp.clip(middle, -STEERING_SCALE, STEERING_SCALE), 0.0)
    # A reading that is NaN is no end of a gap.
    steering = angle / STEERING_SCALE + 0 * jnp.sum(scan)
    eased = parameters.base_speed + (1 - jnp.abs(steering)) * parameters.variable_speed
    speed = jnp.where(is_gap, eased, parameters.base_speed)
    return Command(steering, jnp.clip(speed, 0.0, MAX_SPEED_COMMAND).astype(scan.dtype))


def widest_run(marked: Array) -> tuple[Array, Array, Array]:
    """First and last index of the longest run of marked beams, the first one on ties.

    Args:
        marked: Bool, (B,).

    Returns:
        The two indices, and whether there is a run at all.
    """
    index = jnp.arange(marked.shape[0])
    unmarked_before = jax.lax.cummax(jnp.where(marked, -1, index))
    length = index - unmarked_before
    last = jnp.argmax(length)
    return last - length[last] + 1, last, length[last] > 0
