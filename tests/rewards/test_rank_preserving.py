"""The rank-preserving reward: more important levels always outweigh all below them."""

from __future__ import annotations

import math
from itertools import pairwise, product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hprs import make_reward, parse_task
from hprs.errors import UsageError
from hprs.rewards import RankPreserving
from hprs.rewards.rank_preserving import levels
from tests.rewards.episodes import rollout

TASK = parse_task(
    """
    signal x in [-1, 1]
    signal y in [-1, 1]
    signal z in [-2, 2]
    ensure    a: x >= 0
    achieve   b: y >= 0
    encourage c: z >= 0
    encourage d: z <= 1
    """
)


def test_by_hand() -> None:
    # a: min(0.5, 0.25) = 0.25; b: max(-0.5, -0.25); the last level: min(c: 1, d: 0) = 0.
    trace = {"x": [0.5, 0.25], "y": [-0.5, -0.25], "z": [1.0, 1.0]}
    wanted = 2.01**3 + (math.tanh(0.25) + math.tanh(-0.25) + 0.0) / 3
    for ends in ((True, False), (False, True)):
        paid = rollout(
            RankPreserving(TASK, margins="raw"), trace, terminated=ends[0], truncated=ends[1]
        )
        assert paid == pytest.approx([wanted])
    # Normalised, c is 1 / 2 and d is 0 / 3.
    trace["z"] = [1.0, 0.5]
    paid = rollout(RankPreserving(TASK), trace, terminated=True, truncated=False)
    assert paid == pytest.approx([2.01**3 + (math.tanh(0.25) + math.tanh(-0.25) + 0.0) / 3])
    trace["z"] = [0.5, 0.5]
    paid = rollout(RankPreserving(TASK, base=3), trace, terminated=True, truncated=False)
    least = min(0.5 / 2, 0.5 / 3)
    assert paid == pytest.approx(
        [3**3 + 3 + (math.tanh(0.25) + math.tanh(-0.25) + math.tanh(least)) / 3]
    )


def test_levels_follow_the_longest_chain_of_more_important_requirements() -> None:
    task = parse_task(
        """
        signal x in [-1, 1]
        encourage e: x <= 0.5
        encourage f: x <= 0.6
        ensure    a: x >= 0
        ensure    b: x >= -0.1
        ensure    c: x >= -0.2
        conquer   g: x >= 0.1
        prefer a over b
        prefer b over c
        prefer f over e
        """
    )
    # Rows: a, b, c, g, e, f.
    assert [(part.operator, part.rows) for part in levels(task)] == [
        ("always", (0,)),
        ("always", (1,)),
        ("always", (2,)),
        ("eventually always", (3,)),
        ("always", (5,)),
        ("always", (4,)),
    ]
    assert [part.rows for part in levels(TASK)] == [(0,), (1,), (2, 3)]


STATES = st.tuples(*[st.floats(-3, 3).filter(lambda v: abs(v) > 1e-9)] * 3)


@given(STATES, STATES, st.sampled_from(["raw", "normalised"]), st.floats(2.001, 20.0))
def test_the_order_of_what_is_satisfied_is_the_order_of_the_rewards(one, other, form, base) -> None:
    """Theorem of the authors, for a above 2: the first level that tells them apart decides."""
    reward = RankPreserving(TASK, base, form)

    def paid(state):
        signals = dict(zip("xyz", state, strict=True))
        return reward.step(reward.init(signals), signals, True, False)[1]

    def satisfied(state):
        x, y, z = state
        return (x > 0, y > 0, 0 < z < 1)

    if satisfied(one) != satisfied(other):
        assert (paid(one) > paid(other)) == (satisfied(one) > satisfied(other))


def test_every_rank_is_above_the_next_one_however_robust_that_is() -> None:
    count = 3
    ranks = sorted(product((0, 1), repeat=count), reverse=True)
    for higher, lower in pairwise(ranks):
        gap = sum(
            2.01 ** (count - i) * (h - w)
            for i, (h, w) in enumerate(zip(higher, lower, strict=True))
        )
        assert gap > 2.0, "the mean of tanh differs by less than 2"


@pytest.mark.parametrize("base", [2, 2.0, 1.5, -3, float("nan"), float("inf"), 1e300, "3", True])
def test_a_base_that_would_not_preserve_ranks_is_one_line(base) -> None:
    with pytest.raises(UsageError, match="base must be a number above 2 whose power 3"):
        make_reward("rank-preserving", TASK, base=base)


def test_margins_are_checked_and_something_must_be_required() -> None:
    with pytest.raises(UsageError, match="margins are normalised or raw"):
        RankPreserving(TASK, margins="row")
    with pytest.raises(UsageError, match="this task has none"):
        RankPreserving(parse_task("signal x in [0, 1]"))
