from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hprs.carsim.actuators import MAX_DELAY
from hprs.carsim.randomisation import QUANTITIES, Parameters, nominal, ranges, sample
from hprs.errors import UsageError


def drawn(name, number=2000):
    keys = jax.random.split(jax.random.key(0), number)
    return jax.jit(jax.vmap(sample, (0, None)))(keys, ranges(name))


def test_nominal_parameters_are_the_defaults():
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-6), nominal(), Parameters())


def test_nominal_ranges_draw_nominal_parameters():
    one = jax.tree.map(lambda leaf: leaf[7], drawn("nominal", 8))
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-6), one, nominal())


def test_the_table_says_unit_and_source_and_contains_its_nominal_values():
    for quantity in QUANTITIES:
        assert quantity.unit
        assert quantity.source
        assert quantity.low <= quantity.nominal <= quantity.high


def test_gains_fill_the_papers_ranges():
    parameters = drawn("released")
    gain = np.asarray(parameters.actuators.speed_gain) * 3.5
    assert 3.5 <= gain.min() < 3.6
    assert 4.8 < gain.max() <= 5.0 + 1e-5
    steering = np.asarray(parameters.actuators.steering_gain)
    assert 0.5 <= steering.min() < 0.51
    assert 0.74 < steering.max() <= 0.75
    assert len(np.unique(parameters.vehicle.mass)) == 1


def test_on_gm_the_papers_code_steers_further():
    assert drawn("released-gm").actuators.steering_gain.min() >= 0.6


def test_all_ranges_vary_every_quantity_independently():
    parameters = drawn("all")
    leaves = [parameters.vehicle.mass, parameters.vehicle.friction, parameters.actuators.delay,
              parameters.actuators.steering_offset, parameters.sensors.lidar_noise]  # fmt: skip
    correlation = np.corrcoef(np.array(leaves, float))
    assert np.abs(correlation - np.eye(len(leaves))).max() < 0.1
    delay = np.asarray(parameters.actuators.delay)
    assert delay.dtype == np.int32
    assert set(delay) == set(range(6))
    assert delay.max() <= MAX_DELAY


def test_a_key_determines_its_parameters():
    first, again = (sample(jax.random.key(3), ranges()) for _ in range(2))
    jax.tree.map(np.testing.assert_array_equal, first, again)
    assert sample(jax.random.key(4), ranges()).vehicle.mass != first.vehicle.mass


def test_parameters_follow_the_type_of_the_ranges():
    with jax.enable_x64(True):
        leaves = jax.tree.leaves(nominal(jnp.float64))
        assert {leaf.dtype for leaf in leaves} == {np.dtype("float64"), np.dtype("int32")}


def test_an_unknown_name_is_refused():
    with pytest.raises(UsageError, match="Did you mean 'nominal'"):
        ranges("nominl")
