"""What a critic is given of signals: numbers of like size, whatever the range."""

import jax.numpy as jnp
import numpy as np
import pytest

import hprs
from hprs.training.signal_scale import signal_scale

TASK = hprs.parse_task(
    """
signal speed in [0, 4]
signal place[2] in [-1, 3]
signal sight in [0, inf]
signal unused in [0, 1]
ensure slow: speed <= 3
ensure near: norm(place) <= 2
ensure far: sight >= 1
"""
)


def scaled(speed, place, sight):
    scale = signal_scale(TASK)
    values = {"speed": [speed], "place": [place], "sight": [sight]}
    return scale(scale.stacked({k: jnp.asarray(v, jnp.float32) for k, v in values.items()}))[0]


def test_ranges_are_mapped_to_1():
    np.testing.assert_allclose(scaled(0, [1, 3], 3), [-1, 0, 1, 0.75])


def test_what_is_far_outside_says_no_more():
    np.testing.assert_allclose(scaled(400, [-9, 1], 0), [2, -2, 0, 0])


@pytest.mark.parametrize(("sight", "wanted"), [(np.inf, 1.0), (-np.inf, -1.0), (-1.0, -0.5)])
def test_without_two_ends_a_range_is_squashed(sight, wanted):
    np.testing.assert_allclose(scaled(2, [1, 1], sight)[-1], wanted)


def test_columns_are_signals_again():
    scale = signal_scale(TASK)
    assert (scale.names, scale.size) == (("speed", "place", "sight"), 4)
    found = scale.by_name(jnp.asarray([[1.0, 2.0, 3.0, 4.0]]))
    assert {name: value.tolist() for name, value in found.items()} == {
        "speed": [1.0],
        "place": [[2.0, 3.0]],
        "sight": [4.0],
    }
