"""Plans: what is left of a grid, and estimates worked by hand."""

from dataclasses import replace

import pytest

from hprs.experiments import plan as plans
from hprs.experiments.plan import Planned, estimate, plan, prepare
from hprs.training.run_directory import RunDirectory
from tests.training.stub import configuration

RATES = {
    "memory": 100,
    "ppo": {"steps_a_second": {"hprs/CartPole-v0": 10}, "disk": {"hprs/CartPole-v0": 2}},
    "sac": {"steps_a_second": {"hprs/CartPole-v0": 5}, "transition": {"hprs/CartPole-v0": 1e6}},
}


@pytest.fixture(autouse=True)
def rates(monkeypatch):
    monkeypatch.setattr(plans, "_rates", lambda: RATES)


def planned(seed=0, state="new", step=0, **changes):
    found = replace(configuration(seed), **changes)
    return Planned(RunDirectory(None), found, state, step)


def test_a_new_grid_makes_its_runs_and_a_begun_one_finds_them(tmp_path):
    found = plan([configuration(seed) for seed in (0, 1)], tmp_path)
    assert [(entry.state, entry.left) for entry in found] == [("new", 100), ("new", 100)]
    runs = prepare(found, tmp_path)
    assert [run.configuration.seed for run in runs] == [0, 1]
    runs[0].save_policy("last", trainer="jax", step=100, name="policy.bundle", data=b"x")
    runs[1].save_policy("last", trainer="jax", step=60, name="policy.bundle", data=b"x")
    again = plan([configuration(seed) for seed in (0, 1, 2)], tmp_path)
    assert [(entry.state, entry.left) for entry in again] == [
        ("done", 0),
        ("begun", 40),
        ("new", 100),
    ]
    assert [run.configuration.seed for run in prepare(again, tmp_path)] == [1, 2]


def test_another_setting_is_another_run(tmp_path):
    prepare(plan([configuration(0)], tmp_path), tmp_path)
    (found,) = plan([configuration(0, learning_rate=0.5)], tmp_path)
    assert found.state == "new"


def test_work_is_shared_by_the_processes_and_the_longest_run_is_a_bound():
    one = planned(steps=1_000)
    assert estimate([one], 4).seconds == 100.0
    assert estimate([one, planned(1, steps=1_000)], 1).seconds == 200.0
    assert estimate([one, planned(1, steps=1_000), planned(2, steps=1_000)], 2).seconds == 150.0
    long = planned(3, steps=10_000)
    assert estimate([one, long], 2).seconds == 1_000.0


def test_what_is_done_costs_nothing_and_what_is_begun_its_rest():
    begun = planned(state="begun", step=400, steps=1_000)
    assert estimate([begun, planned(1, state="done", step=1_000, steps=1_000)], 1).seconds == 60.0


def test_sac_needs_room_for_what_it_remembers():
    parameters = {"buffer_size": 300}
    short = planned(algorithm="sac", parameters=parameters, steps=50)
    long = planned(1, algorithm="sac", parameters=parameters, steps=1_000)
    found = estimate([short, long], 2)
    # A transition is 1 MB in this table: 50 and 300 of them.
    assert (found.memory, found.disk) == (100 + 50 + 100 + 300, 350)
    assert estimate([short, long], 1).memory == 400


def test_what_has_no_rate_is_named_and_not_guessed():
    found = estimate([planned(steps=10), planned(environment="Other-v0")], 1)
    assert found.unknown == ("ppo on Other-v0",)
    assert found.seconds == 1.0
