"""PAM as a reward."""

from __future__ import annotations

import numpy as np
import pytest

from hprs import assess, parse_task
from hprs.rewards import EpisodeAssessment
from tests.rewards.episodes import rollout
from tests.semantics.random_tasks import random_signals, random_task

TASK = parse_task(
    "signal x in [0, 4]\nensure low: x <= 3\nachieve goal: x >= 2\nencourage calm: x <= 1"
)


def test_by_hand() -> None:
    # Safe, on target, calm in two of four steps.
    trace = {"x": [0.0, 0.5, 1.0, 2.0, 1.5]}
    for ends in ((True, False), (False, True)):
        paid = rollout(EpisodeAssessment(TASK), trace, terminated=ends[0], truncated=ends[1])
        assert paid.tolist() == [0.0, 0.0, 0.0, 1.0 + 0.5 + 0.25 * 0.5]


@pytest.mark.parametrize("seed", range(30))
def test_it_is_the_number_of_the_assessment(seed: int) -> None:
    task = random_task(seed, depth=2)
    trace = random_signals(seed, task, (8, 3))
    paid = rollout(EpisodeAssessment(task), trace, terminated=True, truncated=False)
    assert not paid[:-1].any()
    np.testing.assert_array_equal(paid[-1], assess(task, trace).pam)
