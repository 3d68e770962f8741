"""Statistics over seeds, worked by hand and against other implementations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from hprs.experiments.statistics import (
    difference_interval,
    failed_seeds,
    improvement_interval,
    interquartile_mean,
    interval,
    probability_of_improvement,
    steps_to,
)

SEEDS = arrays(float, st.integers(2, 12), elements=st.floats(0, 1))


def test_the_interquartile_mean_of_four_is_that_of_the_middle_two():
    assert interquartile_mean([0.0, 0.2, 0.6, 100.0]) == pytest.approx(0.4)


def test_of_values_on_the_edge_a_part_counts():
    # Of ten, 2.5 are left out on each side: half of the third and of the eighth stay.
    values = np.arange(10.0)
    assert interquartile_mean(values) == pytest.approx((0.5 * 2 + 3 + 4 + 5 + 6 + 0.5 * 7) / 5)
    assert interquartile_mean([1.0, 2.0]) == 1.5
    assert interquartile_mean([3.0]) == 3.0


@given(arrays(float, st.sampled_from([4, 8, 12]), elements=st.floats(0, 1)))
def test_where_quarters_are_whole_it_is_scipys_trimmed_mean(values):
    assert interquartile_mean(values) == pytest.approx(stats.trim_mean(values, 0.25))


def test_it_knows_its_axis():
    values = np.arange(24.0).reshape(2, 4, 3)
    assert interquartile_mean(values, axis=1).tolist() == [[4.5, 5.5, 6.5], [16.5, 17.5, 18.5]]


def test_two_seeds_of_ten_that_stand_still_do_not_show_in_it_but_are_counted():
    values = [1.0] * 8 + [0.0] * 2
    assert interquartile_mean(values) == pytest.approx(1.0)
    assert failed_seeds(values) == 2


def test_an_interval_of_seeds_that_agree_is_a_point():
    low, high = interval([0.7] * 10)
    assert (float(low), float(high)) == (pytest.approx(0.7), pytest.approx(0.7))
    assert interval([0.3]) == (0.3, 0.3)


def test_an_interval_of_two_seeds_is_that_of_the_four_draws():
    # The mean of two draws from 0 and 1: 0, 0.5 and 1 with probabilities 1/4, 1/2, 1/4.
    low, high = interval([0.0, 1.0])
    assert (float(low), float(high)) == (0.0, 1.0)


def test_an_interval_of_the_mean_is_about_the_normal_one():
    values = np.random.default_rng(0).normal(0.0, 1.0, 200)
    low, high = interval(values)
    half = 1.96 * values.std() / np.sqrt(200)
    assert low == pytest.approx(values.mean() - half, abs=0.02)
    assert high == pytest.approx(values.mean() + half, abs=0.02)


def test_curves_have_an_interval_at_each_point():
    curves = np.random.default_rng(0).random((7, 10))
    low, high = interval(curves, interquartile_mean)
    assert low.shape == high.shape == (7,)
    assert (low <= interquartile_mean(curves)).all()
    assert (interquartile_mean(curves) <= high).all()


def test_the_same_seed_gives_the_same_interval():
    values = np.random.default_rng(1).random(10)
    assert interval(values) == interval(values)
    assert interval(values, seed=1) != interval(values)


def test_a_tie_counts_half():
    # Nine pairs: better in (2, 1), (3, 1), (3, 2); equal in (1, 1), (2, 2).
    assert probability_of_improvement([1, 2, 3], [1, 2, 4]) == pytest.approx((3 + 2 / 2) / 9)


@given(SEEDS, SEEDS)
def test_it_is_mann_whitneys_u_over_the_pairs(one, other):
    u = stats.mannwhitneyu(one, other, method="asymptotic").statistic
    assert probability_of_improvement(one, other) == pytest.approx(u / (len(one) * len(other)))


@given(SEEDS, SEEDS)
def test_one_is_better_or_the_other(one, other):
    there, back = probability_of_improvement(one, other), probability_of_improvement(other, one)
    assert there + back == pytest.approx(1.0)


def test_intervals_of_two_rewards_are_points_where_every_seed_says_the_same():
    assert improvement_interval([0.9, 0.9, 0.9], [0.1, 0.1]) == (1.0, 1.0)
    low, high = difference_interval([0.9, 0.9, 0.9], [0.1, 0.1])
    assert (low, high) == (pytest.approx(0.8), pytest.approx(0.8))


def test_the_difference_is_that_of_the_first_from_the_second():
    rng = np.random.default_rng(0)
    low, high = difference_interval(rng.normal(1.0, 0.1, 10), rng.normal(0.0, 0.1, 10))
    assert 0.8 < low < 1.0 < high < 1.2


@pytest.mark.parametrize(
    ("values", "reached"),
    [
        ([0.9, 0.9, 0.9], 10),
        ([0.9, 0.8, 0.9, 1.0, 0.9], 30),
        ([0.9, 0.9, 0.8], None),
        ([0.9, 0.9], None),
        ([], None),
    ],
)
def test_three_evaluations_in_a_row_count(values, reached):
    assert steps_to([10 * (i + 1) for i in range(len(values))], values) == reached
