from __future__ import annotations

import io
from functools import cache

import numpy as np
import pytest

from hprs.experiments.perturbations import Point, points
from hprs.experiments.robustness import assessments, try_policies
from hprs.experiments.robustness_figure import draw
from hprs.experiments.robustness_result import POOLED, SHOWN, Row, as_csv, rows_of
from hprs.semantics.assessment import Assessment
from hprs.spec.parser import parse_task
from hprs.training.evaluation import evaluate
from hprs.training.measures import Measure
from hprs.training.policies import ConstantPolicy

SEEDS = [2_000_000, 2_000_001, 2_000_002]
SWEEPS = {"latency": (0.0, 200.0), "speed_offset": (-1.0,)}


@cache
def made():
    from hprs.cli.assessed_run import named_environment

    return named_environment(
        "hprs/SafeDriving-v0", task_path=None, constants=(), options=("tracks=gm",), horizon=12
    )


def tried():
    return try_policies(
        "throttle",
        made(),
        {"policy": ConstantPolicy(np.array([1.0, 0.0], np.float32))},
        seen=["gm"],
        sweeps=SWEEPS,
        ground=None,
        tracks=(),
        seeds=SEEDS,
        watcher=lambda name: lambda complete: None,
    )


def test_the_same_seeds_give_the_same_table():
    first = tried()
    assert as_csv(first) == as_csv(tried())
    assert [(row.perturbation, row.value) for row in first] == [
        ("as trained", ""),
        ("latency", "0"),
        ("latency", "200"),
        ("speed_offset", "-1"),
    ]


def test_a_point_that_changes_nothing_is_what_hprs_evaluate_measures():
    from hprs.training.simulations import device_environment, simulation_of

    environment = made()()
    simulation = simulation_of(environment)
    device = device_environment(environment.task, environment.reward, environment)
    policy = ConstantPolicy(np.array([1.0, 0.0], np.float32))
    chosen = points(simulation.settings, SWEEPS)
    found = [
        episodes
        for some in assessments(device, simulation, policy, chosen, SEEDS)
        for episodes in some
    ]
    expected = [episode.assessment for episode in evaluate(made(), policy, SEEDS)]
    for one, other in zip(found[0], expected, strict=True):
        assert one.pam == pytest.approx(other.pam, abs=1e-6)
        assert one.length == other.length
    # Told late to drive, a car that accelerates is fast in fewer steps.
    fast = [[one.requirements["fast"] * one.length for one in found[i]] for i in (1, 2)]
    assert all(late <= early for early, late in zip(*fast, strict=True))
    assert sum(fast[1]) < sum(fast[0])


TASK = parse_task("signal x = obs[0] in [0, 1]\nachieve there: x >= 0.5\n")


def assessed(pam):
    return Assessment(pam, True, pam >= 1.5, 1.0, {"there": pam >= 1.5}, 5, False, {})


def point(perturbation, value, trained=False):
    return Point(perturbation, value, "", trained, None)


def test_generated_tracks_are_pooled_for_each_way_round():
    rows = rows_of(
        "one",
        TASK,
        [
            (point("track", "gm", trained=True), [assessed(1.0)]),
            (point("track", "random:1"), [assessed(1.0)]),
            (point("track", "random:2"), [assessed(1.75)]),
            (point("track", "random:3 backwards"), [assessed(1.5)]),
        ],
    )
    found = {row.value: row for row in rows}
    assert found[POOLED].episodes == 2
    assert found[POOLED].measures["S+T"].value == 0.5
    assert found[POOLED].measures["S+T+C"].value == 0.5
    assert found[f"{POOLED} backwards"].measures["S+T"].value == 1.0


def row(policy, perturbation, value, trained, mean):
    measure = Measure(mean, mean - 0.1, mean)
    return Row(policy, perturbation, value, "1", trained, 20, dict.fromkeys(SHOWN, measure))


ROWS = [
    row(policy, perturbation, value, trained, mean)
    for policy, mean in (("one", 0.5), ("other", 0.75))
    for perturbation, value, trained in (
        ("as trained", "", True),
        ("friction", "0.4", False),
        ("friction", "0.8", True),
        ("speed_scale", "1", True),
        ("track", "gm", True),
        ("track", "random:1000", False),
    )
]


def test_the_csv_has_a_row_a_point_with_intervals():
    lines = as_csv(ROWS).splitlines()
    assert lines[0].startswith("policy,perturbation,value,unit,trained,episodes,S,S low,S high,S+T")
    assert lines[2] == "one,friction,0.4,1,no,20" + ",0.5000,0.4000,0.5000" * 3
    assert len(lines) == 1 + len(ROWS)


@pytest.mark.parametrize("chosen", [ROWS, ROWS[:4], ROWS[4:6], ROWS[:1]])
def test_any_rows_make_a_picture_and_the_same_rows_the_same_one(chosen):
    image = pytest.importorskip("PIL.Image")
    found = draw(chosen)
    assert found == draw(chosen)
    assert found["svg"].startswith(b"<?xml")
    assert image.open(io.BytesIO(found["png"])).width > 800
