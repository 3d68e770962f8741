import sys

import numpy as np
import pytest

from hprs.errors import MissingExtraError
from hprs.training.intervals import bootstrap_mean, require_statistics, wilson


# Newcombe (1998), Statistics in Medicine 17, table I, method 3.
@pytest.mark.parametrize(
    ("successes", "count", "low", "high"),
    [
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilson_gives_published_intervals(successes, count, low, high):
    assert wilson(successes, count) == pytest.approx((low, high), abs=5e-5)


def test_wilson_is_symmetric_and_stays_in_the_unit_interval():
    low, high = wilson(0, 10)
    assert (1 - high, 1 - low) == pytest.approx(wilson(10, 10))
    assert low == 0.0


def test_the_bootstrap_of_equal_values_is_a_point():
    assert bootstrap_mean([0.5, 0.5, 0.5]) == (0.5, 0.5)
    assert bootstrap_mean([0.25]) == (0.25, 0.25)
    assert bootstrap_mean([0.1 + 0.2, 0.3]) == pytest.approx((0.3, 0.3))
    assert bootstrap_mean([1e-200, 0.0]) == pytest.approx((0.0, 0.0))


def test_the_bootstrap_agrees_with_the_normal_interval_of_a_large_sample():
    values = np.random.default_rng(0).normal(1.0, 2.0, 400)
    low, high = bootstrap_mean(values)
    half = 1.96 * values.std() / 20
    assert low == pytest.approx(values.mean() - half, abs=0.03)
    assert high == pytest.approx(values.mean() + half, abs=0.03)


def test_the_bootstrap_leans_towards_the_long_tail():
    values = np.random.default_rng(0).exponential(1.0, 30)
    low, high = bootstrap_mean(values)
    assert high - values.mean() > values.mean() - low


def test_the_bootstrap_of_many_values_depends_on_its_seed_only():
    values = np.random.default_rng(1).beta(5, 1, 2_000)
    assert bootstrap_mean(values) == bootstrap_mean(values, seed=0)
    assert bootstrap_mean(values) != bootstrap_mean(values, seed=1)


def test_one_odd_value_among_many_has_an_interval():
    low, high = bootstrap_mean([0.0] * 49 + [1.0])
    assert 0.0 <= low <= 0.02 <= high <= 0.2


def test_missing_statistics_say_how_to_install_them(monkeypatch):
    monkeypatch.setitem(sys.modules, "scipy", None)
    with pytest.raises(MissingExtraError, match=r"^scipy is not installed.*hprs\[report\]"):
        require_statistics()
