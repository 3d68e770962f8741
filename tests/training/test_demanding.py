"""Tasks that ask too little, and tasks that do not."""

import numpy as np
import pytest

from hprs import assess, parse_task
from hprs.training.demanding import held_at_every_reset, remarks
from hprs.training.environment import find_task, make_environment

TASK = parse_task(
    """
    signal x in [-2, 2]
    ensure low: x <= 1.5
    achieve zero: x <= 0
    encourage bounded: x <= 1
    """
)
REACHED, MISSED = (
    assess(TASK, {"x": np.array(values, dtype=float)}) for values in ((0.5, -0.5), (0.5, 1.2))
)


def test_a_task_that_floors_miss_gets_no_remark():
    assert remarks(TASK, [], {"random": [MISSED, MISSED], "doing nothing": [MISSED, REACHED, MISSED]}) == []  # fmt: skip


def test_a_floor_that_meets_the_task_is_named():
    found = remarks(TASK, [], {"random": [MISSED], "doing nothing": [REACHED, MISSED]})
    assert found == ["doing nothing meets the task in 50% of its episodes."]


def test_a_target_that_holds_at_every_reset_is_named():
    found = remarks(TASK, ["zero"], {"random": [MISSED]})
    assert found == ["'zero', the target, holds at every reset: there is nothing to reach."]


@pytest.mark.parametrize(
    ("floors", "named"), [([REACHED], True), ([REACHED, MISSED], False), ([MISSED], False)]
)
def test_a_wish_that_no_floor_fails_is_named(floors, named):
    found = remarks(TASK, ["bounded"], {f"floor {i}": [x] for i, x in enumerate(floors)})
    sentence = "'bounded' holds from the reset on whatever is done: it asks nothing."
    assert (sentence in found) == named
    assert sentence not in remarks(TASK, [], {"floor": [REACHED]})


def test_without_a_target_a_floor_that_is_safe_is_no_remark():
    task = parse_task("signal x in [-2, 2]\nensure low: x <= 1.5\nencourage small: x <= -1")
    safe = assess(task, {"x": np.array([0.5, 0.5])})
    assert remarks(task, [], {"doing nothing": [safe]}) == []


def test_resets_are_those_of_the_environment():
    name = "hprs/CartPole-v0"
    task, _ = find_task(name)
    held = held_at_every_reset(lambda: make_environment(name, task), range(20))
    # The pole begins upright and slow; the cart begins off its mark.
    assert "slow" in held
    assert "parked" not in held
