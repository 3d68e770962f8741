"""The driving tasks in closed form, without JAX."""

from __future__ import annotations

import math

import pytest

from hprs.envs import task_of
from hprs.semantics.evaluation import scores

SAFE, FOLLOW = "hprs/SafeDriving-v0", "hprs/FollowLeader-v0"
COMMANDS = {
    "steering": 0.0,
    "speed_command": 0.0,
    "last_steering": 0.0,
    "last_speed_command": 0.0,
}
BASE = {
    SAFE: {"progress": 0.5, "collision": 0.0, "clearance": 0.5, "speed": 2.0, **COMMANDS},
    FOLLOW: {
        "progress": 0.5, "collision": 0.0, "lead_distance": -1.75, "leader_contact": 0.0, **COMMANDS,
    },
}  # fmt: skip
WORST_CHANGE = math.sqrt(8)


@pytest.mark.parametrize(
    ("name", "state", "label", "margin", "score"),
    [
        *(
            (name, *case)
            for name in (SAFE, FOLLOW)
            for case in [
                ({}, "no_collision", 0.5, 1.0),
                ({"collision": 1.0}, "no_collision", -0.5, 0.0),
                ({"progress": 0.0}, "lap", -1.0, 0.0),
                ({"progress": 0.25}, "lap", -0.75, 0.25),
                ({"progress": 1.0}, "lap", 0.0, 1.0),
                ({"progress": -0.2}, "lap", -1.2, 0.0),
                ({"steering": -0.1}, "straight", 0.0, 1.0),
                ({"steering": 0.55}, "straight", -0.45, 0.5),
                ({"steering": 0.15, "speed_command": 0.2}, "smooth", 0.0, 1.0),
                (
                    {"steering": 1.0, "last_steering": -1.0, "speed_command": 1.0,
                     "last_speed_command": -1.0},
                    "smooth", 0.25 - WORST_CHANGE, 0.0,
                ),
                # A full change of speed is smooth if the car is not steered.
                ({"speed_command": 0.8 / 3.5}, "smooth", 0.25 - 0.8 / 3.5, 1.0),
            ]
        ),
        (SAFE, {"clearance": 0.25}, "centred", -0.25, 0.5),
        (SAFE, {"speed": 0.5}, "fast", -1.5, 0.25),
        (SAFE, {"speed": 3.5}, "not_too_fast", 0.0, 1.0),
        (SAFE, {"speed": 4.25}, "not_too_fast", -0.75, 0.5),
        (FOLLOW, {"lead_distance": -0.75}, "keep_distance", 0.0, 1.0),
        (FOLLOW, {"lead_distance": -0.5}, "keep_distance", -0.25, 0.0),
        (FOLLOW, {"leader_contact": 1.0}, "keep_distance", -0.5, 0.0),
        (FOLLOW, {"lead_distance": -2.0}, "not_too_far", 0.0, 1.0),
        (FOLLOW, {"lead_distance": -3.5}, "not_too_far", -1.5, 0.5),
        (FOLLOW, {"lead_distance": -9.0}, "not_too_far", -7.0, 0.0),
        (FOLLOW, {"lead_distance": -1.5}, "not_too_close", 0.0, 1.0),
        (FOLLOW, {"lead_distance": -0.75}, "not_too_close", -0.75, 0.5),
    ],
)  # fmt: skip
def test_margins_and_scores_in_closed_form(name, state, label, margin, score):
    task, signals = task_of(name), {**BASE[name], **state}
    assert task.margins(signals)[label] == pytest.approx(margin, abs=1e-12)
    assert scores(task, signals)[label] == pytest.approx(score, abs=1e-12)


@pytest.mark.parametrize(("name", "highest"), [(SAFE, 7.0), (FOLLOW, 7.0)])
def test_the_potential_of_a_perfect_state_counts_every_requirement(name, highest):
    task = task_of(name)
    assert task.potential({**BASE[name], "progress": 1.0}) == highest
    # Half a lap earns half of the target and, through the product, half of every comfort.
    safety = sum(requirement.kind == "ensure" for requirement in task.requirements)
    assert task.potential(BASE[name]) == safety + (highest - safety) / 2


@pytest.mark.parametrize(("name", "counts"), [(SAFE, (1, 1, 5)), (FOLLOW, (2, 1, 4))])
def test_there_are_as_many_requirements_of_each_kind_as_the_paper_says(name, counts):
    kinds = [requirement.kind for requirement in task_of(name).requirements]
    assert tuple(kinds.count(kind) for kind in ("ensure", "achieve", "encourage")) == counts
