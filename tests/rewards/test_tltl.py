"""TLTL: the robustness of an episode, at its end."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hprs import parse_task
from hprs.errors import UsageError
from hprs.rewards import EpisodeRobustness
from tests.rewards.episodes import rollout

SIGNALS = "signal x in [-2, 10]\nsignal y in [-1, 1]\n"
ACHIEVE = parse_task(f"{SIGNALS}ensure low: x <= 6\nachieve goal: y >= 0.5\nencourage z: x <= -1")
CONQUER = parse_task(f"{SIGNALS}ensure low: x <= 6\nconquer goal: y >= 0.5")
TRACE = {"x": [0.0, 5.0, 2.0], "y": [0.0, 0.75, 0.6]}


@pytest.mark.parametrize(
    ("task", "margins", "paid"),
    [
        # low: min(6, 1, 4) = 1; goal: max(-0.5, 0.25, 0.1) = 0.25.
        (ACHIEVE, "raw", 0.25),
        # low in [-4, 8]: 1 / 8; goal in [-1.5, 0.5]: 0.25 / 0.5.
        (ACHIEVE, "normalised", 0.125),
        # goal: eventually always is the last state's.
        (CONQUER, "raw", 0.1),
        (CONQUER, "normalised", 0.125),
    ],
)
@pytest.mark.parametrize(("terminated", "truncated"), [(True, False), (False, True), (True, True)])
def test_by_hand_at_any_end(task, margins, paid, terminated, truncated) -> None:
    reward = EpisodeRobustness(task, margins)
    found = rollout(reward, TRACE, terminated=terminated, truncated=truncated)
    assert found == pytest.approx([0.0, paid])


def test_nothing_is_paid_before_the_end() -> None:
    found = rollout(EpisodeRobustness(ACHIEVE), TRACE, terminated=False, truncated=False)
    assert found.tolist() == [0.0, 0.0]


def test_a_violation_in_the_first_state_counts() -> None:
    trace = {"x": [8.0, 0.0, 0.0], "y": [0.0, 1.0, 1.0]}
    found = rollout(EpisodeRobustness(ACHIEVE, "raw"), trace, terminated=False, truncated=True)
    assert found.tolist() == [0.0, -2.0]


def test_normalised_margins_of_parts_are_compared_and_not_metres_with_radians() -> None:
    task = parse_task(f"{SIGNALS}ensure both: x <= 6 and y <= 0.5\nachieve any: x >= 0 or y >= 0.5")
    # x <= 6: 2 / 8; y <= 0.5: 0.2 / 1.5; so `both` is the latter. any: max(4 / 10, -0.2 / 1.5).
    state = {"x": 4.0, "y": 0.3}
    reward = EpisodeRobustness(task)
    _, paid = reward.step(reward.init(state), state, True, False)
    assert paid == pytest.approx(0.2 / 1.5)


def test_margins_outside_of_their_bounds_are_clipped() -> None:
    state = {"x": 30.0, "y": 1.0}
    reward = EpisodeRobustness(ACHIEVE)
    assert reward.step(reward.init(state), state, True, False)[1] == -1.0
    raw = EpisodeRobustness(ACHIEVE, "raw")
    assert raw.step(raw.init(state), state, True, False)[1] == -24.0


@given(st.lists(st.floats(-2, 10), min_size=2, max_size=8), st.integers(0, 2**32 - 1))
def test_positive_only_if_the_task_is_met_and_negative_only_if_it_is_not(x, seed) -> None:
    y = np.random.default_rng(seed).uniform(-1, 1, len(x)).tolist()
    for task in (ACHIEVE, CONQUER):
        for margins in ("raw", "normalised"):
            reward = EpisodeRobustness(task, margins)
            paid = rollout(reward, {"x": x, "y": y}, terminated=False, truncated=True)[-1]
            on_target = any(v >= 0.5 for v in y) if task is ACHIEVE else y[-1] >= 0.5
            met = all(v <= 6 for v in x) and on_target
            assert paid >= 0.0 if met else paid < 0.0


def test_without_safety_or_without_target_the_other_one_is_the_formula() -> None:
    for text, paid in (("ensure low: x <= 6", 1.0), ("achieve goal: x >= 2", 3.0)):
        reward = EpisodeRobustness(parse_task(f"{SIGNALS}{text}"), "raw")
        found = rollout(reward, TRACE, terminated=True, truncated=False)
        assert found.tolist() == [0.0, paid]


@pytest.mark.parametrize(
    ("text", "margins", "message"),
    [
        ("signal x in [0, 1]\nencourage a: x <= 0.5", "raw", "tltl pays for safety and target"),
        ("signal x in [0, 1]\nensure a: x <= 0.5", "rwa", "normalised or raw, got 'rwa'. Did you"),
        (
            "signal x in [0, inf]\nensure a: x <= 0.5",
            "normalised",
            r"requirement 'a' has the bounds \[-inf, 0.5\], .* or choose margins='raw'",
        ),
    ],
)
def test_what_cannot_be_paid_is_one_line(text, margins, message) -> None:
    with pytest.raises(UsageError, match=message):
        EpisodeRobustness(parse_task(text), margins)


def test_raw_margins_need_no_bounds_and_comfort_none_at_all() -> None:
    EpisodeRobustness(parse_task("signal x in [0, inf]\nensure a: x <= 0.5"), "raw")
    text = "signal x in [0, inf]\nsignal y in [0, 1]\nensure a: y <= 0.5\nencourage b: x >= 0.5"
    EpisodeRobustness(parse_task(text))


def test_memory_does_not_grow_with_the_episode() -> None:
    reward, state = EpisodeRobustness(ACHIEVE), {"x": 0.0, "y": 0.0}
    memory = reward.init(state)
    for _ in range(1000):
        memory, _ = reward.step(memory, state, False, False)
    assert memory == reward.init(state)
