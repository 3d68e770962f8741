"""What each requirement adds to the potential, against values worked by hand and the potential."""

import jax.numpy as jnp
import numpy as np
import pytest
import torch

from hprs import parse_task
from hprs.errors import SignalError
from hprs.rewards.hierarchical import Hierarchical
from hprs.semantics.contributions import contributions
from hprs.semantics.evaluation import potential
from tests.semantics.random_tasks import random_signals, random_task

TASK = parse_task(
    """
    signal wall in [-1, 4]
    signal lap in [0, 1]
    signal speed in [0, 4]
    encourage slow: speed <= 2
    ensure clear: wall >= 0
    conquer finish: lap >= 1
    encourage calm: speed <= 3
    prefer slow over calm
    """
)


def test_a_requirement_adds_its_score_times_those_of_more_important_ones():
    # finish: 0.5; slow: 1 - 1/2 = 0.5, times 0.5; calm: met, times 0.5 * 0.5.
    found = contributions(TASK, {"wall": 1.0, "lap": 0.5, "speed": 3.0})
    assert found == {"slow": 0.25, "clear": 1.0, "finish": 0.5, "calm": 0.25}
    assert list(found) == list(TASK.labels)


def test_after_a_violation_of_safety_nothing_else_counts():
    found = contributions(TASK, {"wall": -0.5, "lap": 1.0, "speed": 0.0})
    assert set(found.values()) == {0.0}


@pytest.mark.parametrize("preferences", [0, 2])
@pytest.mark.parametrize("seed", range(12))
def test_contributions_add_up_to_the_potential(seed, preferences):
    task = random_task(seed, preferences=preferences)
    signals = random_signals(seed, task, (5, 3), spread=1.3)
    terms = contributions(task, signals)
    assert list(terms) == list(task.labels)
    np.testing.assert_allclose(sum(terms.values()), potential(task, signals), rtol=1e-12, atol=0)


@pytest.mark.parametrize("make", [jnp.asarray, torch.asarray], ids=["jax", "torch"])
def test_other_arrays_give_the_same(make):
    states = {"wall": [1.0, -0.5, 2.0], "lap": [0.5, 1.0, 0.25], "speed": [3.0, 0.0, 4.0]}
    ours = contributions(TASK, {name: np.array(values) for name, values in states.items()})
    others = contributions(TASK, {name: make(values) for name, values in states.items()})
    for label, values in ours.items():
        np.testing.assert_allclose(np.asarray(others[label]), values, rtol=1e-6)


def test_their_changes_add_up_to_the_shaping_of_the_paper():
    rng = np.random.default_rng(0)
    trace = {"wall": rng.uniform(-0.1, 4, 40), "lap": rng.uniform(0, 1.2, 40), "speed": rng.uniform(0, 4, 40)}  # fmt: skip
    changes = sum(np.diff(terms) for terms in contributions(TASK, trace).values())
    reward = Hierarchical(TASK, end="paper")
    states = [{name: float(values[i]) for name, values in trace.items()} for i in range(40)]
    memory = reward.init(states[0])
    for i, state in enumerate(states[1:]):
        memory, paid = reward.step(memory, state, False, False)
        base = float(state["lap"] >= 1)
        assert paid == pytest.approx(base + changes[i], abs=1e-12)


def test_a_missing_signal_is_named():
    with pytest.raises(SignalError, match="signal 'lap' is missing"):
        contributions(TASK, {"wall": 1.0, "speed": 0.0})
