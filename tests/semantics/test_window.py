"""Sliding windows against their definitions."""

from __future__ import annotations

import time
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from hprs.semantics.window import ALL, LEAST, MEAN, MEAN_OF_MINIMA, RUN, Filter

NUMBERS: dict[str, tuple[Filter, Any]] = {
    "least": (LEAST, min),
    "mean": (MEAN, lambda x: sum(x) / len(x)),
    "mean of minima": (MEAN_OF_MINIMA, lambda x: sum(min(x[j:]) for j in range(len(x))) / len(x)),
}
TRUTHS = {"run": (RUN, NUMBERS["mean of minima"][1]), "all": (ALL, min)}
SEQUENCES = st.lists(st.floats(-1, 1), min_size=1, max_size=60)


def found(filter: Filter, values: list[Any], size: int) -> list[Any]:
    memory = filter.begin(values[0], size)
    values_of = [filter.value(memory, size)]
    for value in values[1:]:
        memory = filter.push(memory, value, size)
        values_of.append(filter.value(memory, size))
    return values_of


def wanted(definition: Any, values: list[float], size: int) -> list[float]:
    return [definition(values[max(0, t + 1 - size) : t + 1]) for t in range(len(values))]


@pytest.mark.parametrize("name", NUMBERS)
@given(SEQUENCES, st.integers(1, 15))
def test_filters_of_numbers(name: str, values: list[float], size: int) -> None:
    filter, definition = NUMBERS[name]
    expected = wanted(definition, values, size)
    np.testing.assert_allclose(found(filter, values, size), expected, atol=1e-12)
    rows = [np.array([value, -value]) for value in values]
    batch = np.array(found(filter, rows, size))
    np.testing.assert_allclose(batch[:, 0], expected, atol=1e-12)
    negative = wanted(definition, [-value for value in values], size)
    np.testing.assert_allclose(batch[:, 1], negative, atol=1e-12)


@pytest.mark.parametrize("name", TRUTHS)
@given(st.lists(st.sampled_from([0.0, 1.0]), min_size=1, max_size=60), st.integers(1, 15))
def test_filters_of_truth_values(name: str, values: list[float], size: int) -> None:
    filter, definition = TRUTHS[name]
    expected = wanted(definition, values, size)
    np.testing.assert_allclose(found(filter, values, size), expected, atol=1e-12)
    batch = found(filter, [np.array([value, 1.0 - value]) for value in values], size)
    np.testing.assert_allclose([row[0] for row in batch], expected, atol=1e-12)


@pytest.mark.parametrize("size", [1, 2, 3, 5, 20])
@pytest.mark.parametrize("at", range(9))
@pytest.mark.parametrize("name", NUMBERS)
def test_nan_is_in_a_window_as_long_as_its_state(name: str, at: int, size: int) -> None:
    filter, definition = NUMBERS[name]
    values = np.random.default_rng(at).uniform(-1, 1, 14)
    values[at] = np.nan
    expected = np.array(wanted(definition, np.nan_to_num(values).tolist(), size))
    expected[at : at + size] = np.nan
    np.testing.assert_allclose(found(filter, values.tolist(), size), expected, atol=1e-12)
    rows = found(filter, [np.array([value, 0.0]) for value in values], size)
    np.testing.assert_allclose(np.array(rows)[:, 0], expected, atol=1e-12)
    assert not np.isnan(np.array(rows)[:, 1]).any()


@pytest.mark.parametrize("convert", [jnp.asarray, torch.asarray])
@pytest.mark.parametrize("name", [*NUMBERS, *TRUTHS])
def test_other_arrays(name: str, convert: Any) -> None:
    filter, definition = (NUMBERS | TRUTHS)[name]
    values = [0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0]
    rows = [convert(np.array([[value, 1.0 - value]], np.float32)) for value in values]
    batch = np.array([np.asarray(row) for row in found(filter, rows, 3)])
    np.testing.assert_allclose(batch[:, 0, 0], wanted(definition, values, 3), rtol=1e-6)


@pytest.mark.parametrize("pattern", ["rising", "falling", "random", "saw"])
@pytest.mark.parametrize("name", NUMBERS)
def test_a_step_on_floats_takes_constant_time_on_average(name: str, pattern: str) -> None:
    """A window of 8,000 takes no longer than one of 20; O(H) would take hundreds of times that."""
    filter = NUMBERS[name][0]
    count = 20_000
    values: list[float] = {
        "rising": np.linspace(-1, 1, count),
        "falling": np.linspace(1, -1, count),
        "random": np.random.default_rng(0).uniform(-1, 1, count),
        "saw": np.arange(count) % 1000 / 1000.0,
    }[pattern].tolist()

    def taken(size: int) -> float:
        start = time.process_time()
        memory = filter.begin(values[0], size)
        for value in values:
            memory = filter.push(memory, value, size)
            filter.value(memory, size)
        return time.process_time() - start

    assert taken(8_000) < 10.0 * taken(20) + 0.05
