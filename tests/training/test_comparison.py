"""Paired differences, worked by hand."""

import numpy as np
import pytest

from hprs import assess, parse_task
from hprs.training.comparison import compare

TASK = parse_task(
    """
    signal x in [-2, 2]
    ensure low: x <= 1
    achieve zero: x <= 0
    encourage negative: x <= -1
    """
)


def episode(*values):
    return assess(TASK, {"x": np.array(values, dtype=float)})


SAFE = episode(0.5, 0.5)
"""PAM 1: safe, not on target."""
UNSAFE = episode(0.5, 1.5)
"""PAM 0."""
MET = episode(0.5, -0.5)
"""PAM 1.5: on target without comfort."""


def test_differences_are_those_of_the_second_from_the_first():
    found = compare(TASK, [[SAFE, SAFE, UNSAFE, MET]], [[MET, SAFE, SAFE, SAFE]])
    row = found.differences["S"]
    assert (row.one, row.other, row.difference.value) == (0.75, 1.0, 0.25)
    assert row.difference.low <= 0.25 <= row.difference.high
    row = found.differences["S+T"]
    assert (row.one, row.other, row.difference.value) == (0.25, 0.25, 0.0)
    assert list(found.differences) == [
        "S", "S+T", "S+T+C", "PAM", "ensure low", "achieve zero", "encourage negative",
    ]  # fmt: skip


def test_episodes_are_counted_by_pam_and_a_tie_is_half():
    found = compare(TASK, [[SAFE, SAFE, UNSAFE, MET]], [[MET, SAFE, SAFE, SAFE]])
    assert (found.better, found.worse, found.episodes) == (1, 2, 4)
    assert found.probability == pytest.approx((1 + 0.5) / 4)


def test_an_episode_counts_with_its_mean_over_the_seeds():
    found = compare(TASK, [[SAFE, UNSAFE], [UNSAFE, UNSAFE]], [[SAFE, SAFE]])
    row = found.differences["S"]
    assert (row.one, row.other, row.difference.value) == (0.25, 1.0, 0.75)
    assert found.worse == 2


def test_pairing_makes_an_interval_narrower_than_the_spread_of_the_episodes():
    rng = np.random.default_rng(0)
    easy = rng.random(60) < 0.5
    one = [MET if lucky else UNSAFE for lucky in easy]
    other = [MET if lucky else SAFE for lucky in easy]
    difference = compare(TASK, [one], [other]).differences["S+T"].difference
    assert (difference.value, difference.low, difference.high) == (0.0, 0.0, 0.0)


def test_other_episodes_are_refused():
    with pytest.raises(ValueError, match="same episodes"):
        compare(TASK, [[SAFE, SAFE]], [[SAFE]])
