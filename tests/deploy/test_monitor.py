"""On a robot a task's requirements are what they are where hprs is installed."""

import math

import numpy as np
import pytest

from hprs import parse_task
from hprs.deploy.monitor import Monitor, violated_safety
from hprs.errors import BundleError
from hprs.semantics.evaluation import evaluate_floats
from hprs.semantics.plan import plan_of
from hprs.spec.json_format import task_to_json
from tests.semantics.random_tasks import random_signals, random_task

TASK = """
signal x in [-5, 5]
signal way[2] in [-9, 9]
const mark = 1 + 1
let off = abs(x - mark)
ensure far: off < 3
ensure near: norm(way) <= 5
achieve there: off <= 0.5 and x >= 1
encourage slow: -1 <= x <= 1 or way[0] > 8
"""


@pytest.fixture
def monitor():
    return Monitor(task_to_json(parse_task(TASK.replace(" or way[0] > 8", " or x > 4"))))


def test_verdicts_worked_by_hand(monitor):
    found = {one.label: one for one in monitor({"x": 1.75, "way": [3.0, 4.0]})}
    assert [found[label].margin for label in ("far", "near", "there")] == [2.75, 0.0, 0.25]
    assert [one.satisfied for one in found.values()] == [True, True, True, False]
    assert found["slow"].margin == -0.75
    # Strictness: off is 3.
    found = monitor({"x": 5.0, "way": [3.0, 4.1]})
    assert violated_safety(found) == ["far", "near"]


def test_what_is_not_heard_makes_unknown_what_needs_it(monitor):
    found = {one.label: one.satisfied for one in monitor({"x": 0.0})}
    assert found == {"far": True, "near": None, "there": False, "slow": True}
    found = monitor({"x": math.nan, "way": [9.0, 9.0]})
    assert [one.satisfied for one in found] == [None, False, None, None]
    assert violated_safety(found) == ["near"]


@pytest.mark.parametrize("seed", range(90))
def test_random_tasks_are_judged_as_hprs_semantics_judges_them(seed):
    task = random_task(seed)
    monitor = Monitor(task_to_json(task))
    signals = random_signals(seed, task, (20,))
    for index in range(20):
        one = {name: value[index] for name, value in signals.items()}
        one = {name: float(v) if np.ndim(v) == 0 else v for name, v in one.items()}
        with np.errstate(all="ignore"):
            wanted = evaluate_floats(plan_of(task), one)
        holds = dict(zip(plan_of(task).labels, wanted.satisfied, strict=True))
        found = monitor(one)
        assert sorted(monitor.labels) == sorted(holds)
        for verdict in found:
            margin = wanted.margins[verdict.label]
            assert verdict.margin == pytest.approx(margin, rel=1e-9, abs=1e-9, nan_ok=True)
            # Where a margin is 0 up to rounding, rounding decides.
            if abs(margin) > 1e-8:
                assert verdict.satisfied == holds[verdict.label]


NAN = float("nan")


@pytest.mark.parametrize(
    ("x", "y", "both", "either"),
    [
        (0.0, 0.0, True, True),
        (2.0, NAN, False, None),
        (NAN, 2.0, False, None),
        (0.0, NAN, None, True),
        (NAN, 0.0, None, True),
        (NAN, NAN, None, None),
    ],
)
def test_what_is_known_decides_although_the_rest_is_not(x, y, both, either):
    task = parse_task("""
        signal x in [0, 3]
        signal y in [0, 3]
        ensure both: x <= 1 and y <= 1
        ensure either: x <= 1 or y <= 1
    """)
    found = Monitor(task_to_json(task))({"x": x, "y": y})
    assert [one.satisfied for one in found] == [both, either]
    assert violated_safety(found) == ["both"] * (both is False)


@pytest.mark.parametrize(
    "task",
    [
        {},
        {"signals": [], "constants": [], "definitions": [], "requirements": [{"label": "a"}]},
        {
            "signals": [],
            "constants": [],
            "definitions": [],
            "requirements": [{"label": "a", "kind": "ensure", "predicate": ["==", 1, 2]}],
        },
        {
            "signals": [],
            "constants": [{"name": "a", "value": ["system", "x"]}],
            "definitions": [],
            "requirements": [],
        },
    ],
)
def test_what_is_no_task_is_said_so(task):
    with pytest.raises(BundleError, match="its task cannot be read"):
        Monitor(task)
