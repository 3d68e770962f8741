from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hprs.carsim.leader import (
    BASE_SPEED,
    VARIABLE_SPEED,
    LeaderParameters,
    follow_the_gap,
    sample_leader,
    widest_run,
)

ANGLES = np.deg2rad(np.linspace(135, -135, 64))
LEADER = LeaderParameters(1.5, 0.5, 1.5)


def plain_widest_run(marked):
    best, start = (0, -1, False), None
    for i, mark in enumerate([*marked, False]):
        if mark and start is None:
            start = i
        if not mark and start is not None:
            if i - start > best[1] - best[0] + 1 or not best[2]:
                best = (start, i - 1, True)
            start = None
    return best


def plain_command(scan):
    first, last, found = plain_widest_run(scan > 1.5)
    if not found:
        return 0.0, 1.5
    angle = np.clip((ANGLES[first] + ANGLES[last]) / 2, -0.42, 0.42)
    return angle / 0.42, min(1.5 + (1 - abs(angle) / 0.42) * 0.5, 3.5)


def commands(scans):
    drive = jax.jit(
        jax.vmap(
            lambda scan: follow_the_gap(scan, jnp.asarray(ANGLES, jnp.float32), parameters=LEADER)
        )
    )
    command = drive(jnp.asarray(scans, jnp.float32))
    return np.stack([command.steering, command.speed], axis=1)


def test_random_scans_agree_with_a_plain_loop():
    rng = np.random.default_rng(0)
    scans = np.concatenate(
        [
            rng.uniform(0, 3, (500, 64)),
            np.repeat(rng.uniform(0, 2.5, (300, 8)), 8, axis=1),
            rng.uniform(0, 1.5, (5, 64)),
            np.full((1, 64), 15.0),
            np.full((1, 64), 1.5),
        ]
    ).astype(np.float32)
    expected = np.array([plain_command(scan) for scan in scans])
    np.testing.assert_allclose(commands(scans), expected, atol=1e-5)


@pytest.mark.parametrize(
    ("marks", "expected"),
    [
        ("0000", (0, -1, False)),
        ("1111", (0, 3, True)),
        ("0110110", (1, 2, True)),
        ("1011", (2, 3, True)),
        ("1000", (0, 0, True)),
    ],
)
def test_the_widest_run_is_the_first_on_ties(marks, expected):
    first, last, found = widest_run(jnp.array([mark == "1" for mark in marks]))
    assert bool(found) == expected[2]
    if expected[2]:
        assert (int(first), int(last)) == expected[:2]


def test_a_gap_to_the_left_is_steered_to_the_left():
    scan = np.where(ANGLES > 0.1, 5.0, 1.0)
    assert commands(scan[None])[0, 0] == pytest.approx(1.0)


def test_without_a_gap_it_drives_straight_on_at_its_base_speed():
    np.testing.assert_array_equal(commands(np.ones((1, 64)))[0], [0.0, 1.5])


def test_speeds_fill_their_ranges():
    leaders = jax.vmap(sample_leader)(jax.random.split(jax.random.key(0), 1000))
    for values, (low, high) in (
        (leaders.base_speed, BASE_SPEED),
        (leaders.variable_speed, VARIABLE_SPEED),
    ):
        assert low <= values.min() < low + 0.01
        assert high - 0.01 < values.max() <= high


def test_a_reading_that_is_nan_gives_no_steering():
    scan = jnp.full(64, 3.0).at[20].set(jnp.nan)
    assert np.isnan(follow_the_gap(scan, ANGLES, parameters=LEADER).steering)
