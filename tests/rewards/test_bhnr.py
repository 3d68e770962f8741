"""BHNR: filtering semantics over a sliding window."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hprs import make_reward, parse_task
from hprs.errors import UsageError
from hprs.rewards import WindowRobustness
from hprs.rewards.bhnr import WINDOW_FORMS
from tests.rewards.episodes import filtered, rollout

SIGNALS = "signal obst in [0, 1]\nsignal orig in [0, 1]\n"
CONQUER = parse_task(f"{SIGNALS}ensure clear: obst > 0.1\nconquer there: orig < 0.1")
ACHIEVE = parse_task(f"{SIGNALS}ensure clear: obst > 0.1\nachieve there: orig < 0.1")

FAR = [0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.2, 0.1]
NEAR = [0.9, 0.7, 0.5, 0.3, 0.2, 0.05, 0.2, 0.1, 0.0, 0.0]
FREE = [0.5] * 10
CLOSE = [0.5, 0.5, 0.5, 0.1, 0.1, 0.0, 0.1, 0.5, 0.5, 0.5]


@pytest.mark.parametrize(
    ("orig", "obst", "values"),
    [
        (FAR, FREE, [0.0] * 10),
        (NEAR, FREE, [0.2] * 9 + [0.1]),
        (NEAR, CLOSE, [0.0] * 7 + [0.2, 0.2, 0.1]),
    ],
)
def test_the_released_vectors(orig, obst, values) -> None:
    """Facts C.3, for every position of a window of ten states.

    The reward is the value at the first position. At position i the formula looks at the states
    from there on alone, but still divides by ten: as if those before were safe and off target.
    """
    reward = WindowRobustness(CONQUER, 10, "boolean")
    for position, value in enumerate(values):
        trace = {
            "orig": [1.0] * position + orig[position:],
            "obst": [1.0] * position + obst[position:],
        }
        paid = rollout(reward, trace, terminated=False, truncated=False)
        assert paid[-1] == pytest.approx(value)


def test_strictness_matters_in_the_boolean_form() -> None:
    loose = parse_task(f"{SIGNALS}ensure clear: obst >= 0.1\nconquer there: orig <= 0.1")
    trace = {"orig": [0.1] * 4, "obst": [0.1] * 4}
    for task, value in ((CONQUER, 0.0), (loose, 1.0)):
        reward = WindowRobustness(task, 3, "boolean")
        assert rollout(reward, trace, terminated=False, truncated=False).tolist() == [value] * 3


def test_the_quantitative_form_by_hand() -> None:
    task = parse_task(
        "signal x in [0, 4]\nsignal y in [0, 1]\nachieve a: x >= 2\nensure s: y <= 0.5"
    )
    trace = {"x": [0.0, 3.0, 4.0, 1.0], "y": [0.3, 0.4, 0.0, 0.0]}
    # Normalised: a is -1, 0.5, 1, -0.5; s is 0.4, 0.2, 1, 1. Windows of up to three states.
    paid = rollout(WindowRobustness(task, 3), trace, terminated=False, truncated=False)
    assert paid == pytest.approx([-0.5 / 2, 0.5 / 3, 0.2])
    # conquer: the least from each position on. -1, 0.5; -1, 0.5, 1; -0.5, -0.5, -0.5.
    task = parse_task("signal x in [0, 4]\nconquer a: x >= 2")
    paid = rollout(WindowRobustness(task, 3), {"x": trace["x"]}, terminated=True, truncated=False)
    assert paid == pytest.approx([-0.25, 0.5 / 3, -0.5])


def test_margins_beyond_their_bounds_are_clipped() -> None:
    task = parse_task("signal x in [0, 4]\nachieve a: x >= 2")
    trace = {"x": [100.0, -100.0, 100.0]}
    paid = rollout(WindowRobustness(task, 5), trace, terminated=False, truncated=False)
    assert paid == pytest.approx([0.0, 1 / 3])


@given(
    st.lists(st.tuples(st.floats(-0.5, 1.5), st.floats(-0.5, 1.5)), min_size=2, max_size=40),
    st.integers(1, 12),
    st.sampled_from([CONQUER, ACHIEVE]),
    st.sampled_from(WINDOW_FORMS),
)
def test_every_window_of_every_length_is_worth_what_its_definition_says(
    states, size, task, form
) -> None:
    orig, obst = (np.array(values) for values in zip(*states, strict=True))
    trace = {"orig": orig, "obst": obst}
    reward = WindowRobustness(task, size, form)
    lists = {name: values.tolist() for name, values in trace.items()}
    paid = rollout(reward, lists, terminated=False, truncated=False)
    whole = trace | {"env_reward": orig}
    for t in range(1, len(orig)):
        window = slice(max(0, t + 1 - size), t + 1)
        assert paid[t - 1] == pytest.approx(filtered(task, whole, window, form), abs=1e-12)
    assert np.all(np.abs(paid) <= 1.0 + 1e-12)
    batch = {name: values[:, None] for name, values in trace.items()}
    found = rollout(reward, batch, terminated=False, truncated=False)
    np.testing.assert_allclose(found[:, 0], paid, atol=1e-12)


@pytest.mark.parametrize("form", WINDOW_FORMS)
@pytest.mark.parametrize("task", [CONQUER, ACHIEVE])
def test_what_has_left_the_window_is_forgotten(task, form) -> None:
    rng = np.random.default_rng(0)
    end = rng.uniform(size=(2, 6))
    found = []
    for seed in range(3):
        before = np.random.default_rng(seed).uniform(size=(2, 500 * (seed + 1)))
        orig, obst = np.concatenate([before, end], axis=1).tolist()
        reward = WindowRobustness(task, 6, form)
        trace = {"orig": orig, "obst": obst}
        found.append(rollout(reward, trace, terminated=False, truncated=False)[-1])
    np.testing.assert_allclose(found, found[0], atol=1e-14)


def test_one_of_safety_and_target_suffices() -> None:
    trace = {"orig": [0.05, 0.05, 0.5], "obst": [0.5, 0.05, 0.5]}
    safe = parse_task(f"{SIGNALS}ensure clear: obst > 0.1")
    there = parse_task(f"{SIGNALS}achieve there: orig < 0.1")
    ends = dict(terminated=False, truncated=False)
    assert rollout(WindowRobustness(safe, 9, "boolean"), trace, **ends).tolist() == [0.0, 0.0]
    assert rollout(WindowRobustness(there, 9, "boolean"), trace, **ends) == pytest.approx(
        [1, 2 / 3]
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"window": 0}, r"window is a whole number of steps from 1 on, got 0\."),
        ({"window": -3}, r"window is a whole number of steps from 1 on, got -3\."),
        ({"window": 2.5}, r"window is a whole number .* got 2\.5\."),
        ({"window": True}, r"window is a whole number .* got True\."),
        ({"window": "9"}, r"window is a whole number .* got '9'\."),
        ({"window": 9, "form": "bool"}, r"form is quantitative or boolean, got 'bool'"),
    ],
)
def test_wrong_options_are_one_line(options, message) -> None:
    with pytest.raises(UsageError, match=message):
        make_reward("bhnr", CONQUER, horizon=100, **options)
    with pytest.raises(UsageError, match=message):
        WindowRobustness(CONQUER, **options)


def test_the_boolean_form_needs_no_bounds() -> None:
    task = parse_task("signal x in [0, inf]\nensure a: x <= 0.5")
    with pytest.raises(UsageError, match=r"'a' has the bounds .* or choose form='boolean'"):
        WindowRobustness(task, 5)
    WindowRobustness(task, 5, "boolean")


def test_comfort_alone_says_nothing() -> None:
    with pytest.raises(UsageError, match="bhnr pays for safety and target requirements"):
        WindowRobustness(parse_task("signal x in [0, 1]\nencourage a: x <= 0.5"), 5)
