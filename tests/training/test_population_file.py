import json
import os
from dataclasses import replace
from pathlib import Path

import pytest

from hprs.errors import RunError
from hprs.training.population_file import (
    is_population,
    population_of,
    read_population,
    write_population,
)
from hprs.training.run_directory import create_runs, find_runs
from tests.training.stub import configuration


@pytest.fixture
def runs(tmp_path):
    rewards = ("hprs", "sparse")
    made = [replace(configuration(seed), reward=reward) for reward in rewards for seed in range(2)]
    return create_runs(made, tmp_path / "runs")


@pytest.fixture
def population(runs):
    return write_population([run.path for run in runs])


def test_members_are_listed_by_their_paths_from_the_file(runs, population):
    assert population.parent == runs[0].path.parents[1]
    assert len(population.stem.removeprefix("population-")) == 8
    content = json.loads(population.read_text())
    assert content["members"] == [
        run.path.relative_to(population.parent).as_posix() for run in runs
    ]
    assert read_population(population) == [run.path for run in runs]
    assert is_population(population)
    assert not is_population(runs[0].path)


def test_the_same_members_have_the_same_file(runs, population):
    assert write_population([run.path for run in reversed(runs)]) == population
    assert write_population([run.path for run in runs[:2]]) != population


def test_a_population_may_be_moved(runs, population, tmp_path):
    moved = tmp_path / "elsewhere"
    population.parent.rename(moved)
    assert read_population(moved / population.name)[0] == moved.joinpath(*runs[0].path.parts[-2:])


def test_a_member_and_its_seeds_find_the_newest_population(runs, population):
    for place in (runs[3].path, runs[3].path.parent):
        assert population_of(place) == population
    smaller = write_population([run.path for run in runs[2:]])
    os.utime(smaller, ns=(0, population.stat().st_mtime_ns + 1))
    assert population_of(runs[3].path) == smaller
    assert population_of(runs[0].path) == population
    assert population_of(runs[0].path.parent / "seed-7") is None


def test_a_relative_path_finds_a_relative_one(runs, population, monkeypatch):
    monkeypatch.chdir(population.parents[1])
    assert population_of(Path(population.parent.name, *runs[0].path.parts[-2:])) == Path(
        population.parent.name, population.name
    )
    monkeypatch.chdir(runs[0].path)
    assert population_of(Path()) == Path("..", "..", population.name)


def test_the_members_of_a_population_are_found_where_they_may_differ(runs, population):
    assert find_runs(population, mixed=True) == runs
    with pytest.raises(RunError) as error:
        find_runs(population)
    folders = f"{runs[0].path.parent}, {runs[2].path.parent}"
    assert str(error.value) == (
        f"the runs in '{population}' differ in more than the seed; name one of them: {folders}."
    )
    seeds = write_population([run.path for run in reversed(runs[:2])])
    assert find_runs(seeds) == runs[:2]


def test_a_member_that_is_gone_is_said(runs, population):
    (runs[1].path / "run.json").unlink()
    with pytest.raises(RunError) as error:
        find_runs(population, mixed=True)
    assert str(error.value) == (
        f"{population} lists {runs[1].path}, and there is no run.json. Take it from the list."
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "is damaged."),
        ("[]", "is damaged."),
        ('{"format": 1, "members": "x"}', "is damaged."),
        ('{"format": 1, "members": [3]}', "is damaged."),
        ('{"format": 2, "members": []}', "is of format 2; this hprs reads format 1."),
        ('{"format": 1, "members": []}', "lists no run, and there is no run.json. Take it from the list."),
    ],
)  # fmt: skip
def test_what_is_no_population_is_one_line(population, text, message):
    population.write_text(text)
    with pytest.raises(RunError) as error:
        find_runs(population)
    assert str(error.value) == f"{population} {message}"
