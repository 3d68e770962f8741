"""The vector reward: one number a requirement."""

from __future__ import annotations

import numpy as np
import pytest

from hprs import make_reward, parse_task
from hprs.errors import UsageError
from hprs.rewards import ENDS, RequirementVector, Scalarized
from tests.rewards.episodes import rollout
from tests.semantics.random_tasks import random_signals, random_task

TASK = parse_task(
    "signal x in [-1, 4]\nencourage calm: x <= 1\nensure low: x <= 3\nachieve goal: x >= 2"
)


def test_by_hand_in_the_order_of_the_text() -> None:
    trace = {"x": [0.0, 2.0, 4.0]}
    ends = dict(terminated=False, truncated=True)
    # Scores of calm, low, goal: 1, 1, 1/3; 2/3, 1, 1; 0, 0, 1. Base reward 1 twice.
    np.testing.assert_allclose(
        rollout(RequirementVector(TASK), trace, **ends),
        [[1 - 1 / 3, 1.0, 1 + 2 / 3], [1 - 2 / 3, 0.0, 1.0]],
    )
    np.testing.assert_allclose(
        rollout(RequirementVector(TASK, "score"), trace, **ends), [[2 / 3, 1, 1], [0, 0, 1]]
    )


@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize("terminated", [True, False])
@pytest.mark.parametrize("seed", range(10))
def test_weights_of_one_in_total_make_the_morl_reward_of_it(seed, terminated, end) -> None:
    task = random_task(seed, target=("achieve", "conquer")[seed % 2], depth=2)
    trace = random_signals(seed, task, (9, 5))
    weights = np.random.default_rng(seed).dirichlet(np.ones(len(task.requirements)))
    ends = dict(terminated=np.full(5, terminated), truncated=np.full(5, not terminated))
    vector = rollout(make_reward("vector", task, end=end, discount=0.9), trace, **ends)
    scalar = rollout(Scalarized(task, weights, end, 0.9), trace, **ends)
    np.testing.assert_allclose(vector @ weights, scalar, atol=1e-12)


def test_an_unknown_form_is_one_line() -> None:
    with pytest.raises(UsageError, match=r"difference or score, got 'scores'\. Did you mean"):
        make_reward("vector", TASK, form="scores")
