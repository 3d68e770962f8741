"""MORL: weights, and requirements that shape by themselves."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from hprs import make_reward, parse_task
from hprs.envs.registration import BENCHMARKS
from hprs.errors import UsageError
from hprs.rewards import ENDS, Scalarized
from tests.rewards.episodes import rollout
from tests.semantics.random_tasks import random_signals, random_task

TASK = parse_task(
    """
    signal x in [-1, 4]
    encourage calm: x <= 1
    ensure    low:  x <= 3
    achieve   goal: x >= 2
    """
)
# x = 0, 2, 4: scores of `calm` are 1, 2/3, 0; of `low` 1, 1, 0; of `goal` 1/3, 1, 1.
TRACE = {"x": [0.0, 2.0, 4.0]}


def paid(reward: Any, **how: bool) -> np.ndarray:
    return rollout(reward, TRACE, **{"terminated": False, "truncated": False, **how})


def test_by_hand() -> None:
    reward = Scalarized(TASK, {"low": 10.0, "goal": 3.0, "calm": 1.0})
    # Base reward 1 twice; 3 * 2/3 - 1/3, and -10 - 2/3.
    assert paid(reward) == pytest.approx([1 + 2 - 1 / 3, 1 - 10 - 2 / 3])
    assert paid(Scalarized(TASK, [1.0, 10.0, 3.0])) == pytest.approx(paid(reward))
    assert paid(Scalarized(TASK, np.array([1, 10, 3]))) == pytest.approx(paid(reward))


def test_the_three_ends_by_hand() -> None:
    weights = {"low": 10.0, "goal": 3.0, "calm": 1.0}
    # The weighted potentials are 10 + 1 + 1, 10 + 3 + 2/3 and 0 + 3 + 0.
    released = Scalarized(TASK, weights, "released")
    assert paid(released, truncated=True) == pytest.approx([1 + 5 / 3, 1.0])
    invariant = Scalarized(TASK, weights, "invariant", 0.5)
    first = 1 + 0.5 * (13 + 2 / 3) - 12
    assert paid(invariant, terminated=True) == pytest.approx([first, 1 - 13 - 2 / 3])
    assert paid(invariant, truncated=True) == pytest.approx([first, 1 + 1.5 - 13 - 2 / 3])


@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize("seed", range(15))
def test_shaping_telescopes_to_what_the_convention_says(seed: int, end: Any) -> None:
    task = random_task(seed, target="achieve", depth=2)
    trace = random_signals(seed, task, (9, 5))
    weights = np.random.default_rng(seed).uniform(size=len(task.requirements))
    ends = dict(terminated=True, truncated=False)
    base = rollout(make_reward("sparse", task), trace, **ends)
    found = rollout(Scalarized(task, weights, end, 0.9), trace, **ends) - base
    scores = Scalarized(task, weights).init
    at = [{name: values[t] for name, values in trace.items()} for t in (0, -2, -1)]
    first, before_last, last = map(scores, at)
    wanted = {"paper": last - first, "released": before_last - first, "invariant": -first}[end]
    discount = 0.9 if end == "invariant" else 1.0
    np.testing.assert_allclose(np.tensordot(discount ** np.arange(8), found, 1), wanted, atol=1e-12)


def test_named_weights_are_one_in_total_and_fall_by_class() -> None:
    for benchmark in BENCHMARKS.values():
        task = benchmark.task
        uniform = make_reward("morl-uniform", task).weights
        decreasing = make_reward("morl-decreasing", task).weights
        assert sum(uniform) == pytest.approx(1.0)
        assert sum(decreasing) == pytest.approx(1.0)
        assert len(set(uniform)) == 1
        by_class = dict(
            zip([r.requirement_class for r in task.requirements], decreasing, strict=True)
        )
        assert by_class["safety"] == pytest.approx(2 * by_class["target"])
        assert by_class["target"] == pytest.approx(2 * by_class["comfort"])


def test_the_released_weights() -> None:
    """Facts C.4: lunar lander [1, 1, .5, .25, .25] / 3; safe driving as a list of one's own."""
    lander = BENCHMARKS["hprs/LunarLanderObstacle-v0"].task
    found = dict(zip(lander.labels, make_reward("morl-decreasing", lander).weights, strict=True))
    wanted = {"no_collision": 1, "in_world": 1, "landed": 0.5, "upright": 0.25, "no_spin": 0.25}
    assert found == pytest.approx({label: weight / 3 for label, weight in wanted.items()})
    driving = BENCHMARKS["hprs/SafeDriving-v0"].task
    listed = [weight / 1.75 for weight in (1, 0.5, 0.05, 0.05, 0.05, 0.05, 0.05)]
    assert make_reward("morl", driving, weights=listed).weights == tuple(listed)


@given(st.floats(0.0, 100.0), st.integers(0, 20))
def test_shaping_grows_with_the_weights(factor: float, seed: int) -> None:
    task = random_task(seed, target=None, depth=1)
    trace = random_signals(seed, task, (5,))
    ends = dict(terminated=False, truncated=True)
    ones = rollout(Scalarized(task, [1.0] * len(task.labels)), trace, **ends)
    scaled = rollout(Scalarized(task, [factor] * len(task.labels)), trace, **ends)
    np.testing.assert_allclose(scaled, factor * ones, atol=1e-9)


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        ([1, 2], r"the task has 3 requirements \(calm, low, goal\), got 2 weights\."),
        ([1, 2, 3, 4], r"got 4 weights"),
        ([], r"got 0 weights"),
        ([1, -2, 3], r"the weight of 'low' must be a finite number that is not negative, got -2\."),
        ([1, 2, float("nan")], r"the weight of 'goal' must be .* got nan\."),
        ([float("inf"), 2, 3], r"the weight of 'calm' must be .* got inf\."),
        ([1, "2", 3], r"the weight of 'low' must be .* got '2'\."),
        ([1, None, 3], r"the weight of 'low' must be .* got None\."),
        ([1, True, 3], r"the weight of 'low' must be .* got True\."),
        (
            1.0,
            r"weights are a list, one a requirement \(calm, low, goal\), or a mapping from labels, got 1\.0\.$",
        ),
        (
            None,
            r"the reward morl needs the option weights: one number for each of calm, low, goal\.$",
        ),
        (b"abc", r"weights are a list, .* got b'abc'\.$"),
        (
            {1.0, 2.0, 3.0},
            r"weights are a list, .* got \{1\.0, 2\.0, 3\.0\}\. A set has no order\.$",
        ),
        (frozenset({1.0, 2.0, 3.0}), r"weights are a list, .* A set has no order\.$"),
        (np.array(1.0), r"weights are a list, .* got array\(1\.\)\.$"),
        (torch.tensor(1.0), r"weights are a list, .* got tensor\(1\.\)\.$"),
        (jnp.array(1.0), r"weights are a list, .* got Array\(1\., .*\)\.$"),
        ("uniform", r"weights are a list, .* got 'uniform'\."),
        ({"calm": 1, "low": 1}, r"no weight is given for goal\."),
        ({"calm": 1, "low": 1, "gaol": 1}, r"for 'gaol', which is no .* Did you mean 'goal'\?"),
    ],
)
def test_wrong_weights_are_one_line(weights: Any, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        make_reward("morl", TASK, weights=weights)


def test_a_task_without_requirements_shapes_nothing() -> None:
    empty = parse_task("signal x in [0, 1]")
    for name in ("morl-uniform", "morl-decreasing"):
        assert make_reward(name, empty).init({"x": 0.5}) == 0.0
