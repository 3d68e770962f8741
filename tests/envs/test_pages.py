"""The pages of the environments say what the tasks and environments say."""

from __future__ import annotations

import ast
import importlib
import inspect
import re

import gymnasium as gym
import pytest

from hprs.envs import BENCHMARKS
from hprs.spec.printer import format_expression
from tests.envs.pages import FOLDER, PAGES, rendered


def text_of(page: str) -> str:
    return (FOLDER / f"{page}.md").read_text("utf-8")


def cells(text: str, heading: str) -> list[list[str]]:
    """The rows of the first table below a heading, without its header."""
    section = text.split(f"## {heading}\n")[1].split("\n## ")[0]
    rows = re.findall(r"^\| (.*) \|$", section, re.MULTILINE)
    return [row.split(" | ") for row in rows[1:]]


@pytest.mark.parametrize("page", PAGES)
def test_the_derived_part_is_up_to_date(page: str) -> None:
    assert rendered(page, text_of(page)) == text_of(page), "run: python tests/envs/pages.py"


def test_every_benchmark_has_a_page_with_pictures_that_exist() -> None:
    for benchmark in BENCHMARKS.values():
        text = text_of(benchmark.package.rpartition(".")[2])
        assert f"`{benchmark.id}`" in text
        assert f"{benchmark.horizon} steps" in text
        pictures = re.findall(r"!\[.*?\]\((.*?)\)", text)
        assert pictures
        assert all((FOLDER / picture).exists() for picture in pictures)


@pytest.mark.parametrize("page", PAGES)
def test_constants_and_options_have_the_values_of_the_code(page: str) -> None:
    benchmark = BENCHMARKS[PAGES[page]]
    stated = {
        name.strip("`"): value for name, value, *_ in cells(text_of(page), "Constants and options")
    }
    constants = {c.name: format_expression(c.value) for c in benchmark.task.constants}
    module, _, name = benchmark.entry_point.partition(":")
    parameters = inspect.signature(getattr(importlib.import_module(module), name)).parameters
    options = {
        parameter.name: parameter.default
        for parameter in parameters.values()
        if parameter.kind is parameter.KEYWORD_ONLY
    }
    assert stated.keys() == constants.keys() | options.keys()
    for constant, value in constants.items():
        assert stated[constant] in (value, f"{value}.0")
    for option, default in options.items():
        assert ast.literal_eval(stated[option]) == default


@pytest.mark.parametrize("page", PAGES)
def test_every_component_of_the_observation_is_listed(page: str) -> None:
    listed = []
    for index, *_ in cells(text_of(page), "Observation and action"):
        first, *last = map(int, re.findall(r"\d+", index))
        listed += [*range(first, last[0] + 1)] if "to" in index else [first, *last]
    shape = gym.make(PAGES[page]).observation_space.shape
    assert sorted(listed) == list(range(shape[0]))
