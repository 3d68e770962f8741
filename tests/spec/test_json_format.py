from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given

from hprs.errors import SpecError, SpecValidationError
from hprs.spec.expression import call
from hprs.spec.json_format import task_from_json, task_to_json
from hprs.spec.parser import parse_task
from hprs.spec.task import Requirement, Signal, Source, Task
from tests.strategies import tasks

TEXT = """
const top = 2
signal x = obs.pose[0] initially 0 in [-top, top] "m"
signal v[2] = action[:2] in [0, inf]
let d = max(v) in [0, 10]
ensure near: -1.5 <= x <= 1 and (d < 2 or d > 3)
encourage calm: d ** 2 <= 1
prefer near over calm
"""


@given(tasks())
def test_a_task_survives_json(task: Task) -> None:
    assert task_from_json(json.loads(json.dumps(task_to_json(task)))) == task


def test_integers_of_numpy_are_stored_as_integers() -> None:
    source = Source("obs", ["pose"], (np.int64(0), np.int64(3)))  # type: ignore[arg-type]
    x = Signal("x", 0, 1, source=source, length=np.int64(3))  # type: ignore[arg-type]
    y = Signal("y", 0, 1, source=Source("obs", (), np.int8(4)))  # type: ignore[arg-type]
    task = Task([x, y], [Requirement("ensure", "low", call("max", x) + y <= 1)])
    assert task_from_json(json.loads(json.dumps(task_to_json(task)))) == task
    assert task == parse_task(
        "signal x[3] = obs.pose[0:3] in [0, 1]\nsignal y = obs[4] in [0, 1]\n"
        "ensure low: max(x) + y <= 1"
    )


def test_the_format_is_plain_and_short() -> None:
    data = task_to_json(parse_task(TEXT))
    assert data["format"] == 1
    assert data["constants"] == [{"name": "top", "value": 2}]
    assert data["preferences"] == [{"higher": "near", "lower": "calm"}]
    signals = data["signals"]
    assert isinstance(signals, list)
    assert signals[0] == {
        "name": "x",
        "low": ["-", "top"],
        "high": "top",
        "source": {"root": "obs", "keys": ["pose"], "index": 0},
        "length": None,
        "initially": 0,
        "unit": "m",
    }
    assert signals[1]["source"] == {"root": "action", "keys": [], "index": [None, 2]}
    requirements = data["requirements"]
    assert isinstance(requirements, list)
    assert requirements[0] == {
        "kind": "ensure",
        "label": "near",
        "predicate": [
            "and",
            ["<=", ["-", 1.5], "x"],
            ["<=", "x", 1],
            ["or", ["<", "d", 2], [">", "d", 3]],
        ],
    }


def test_reading_json_does_not_import_the_parser() -> None:
    code = "import sys, hprs.spec.json_format as j; print('lark' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "False\n"


def changed(*path: Any, to: Any) -> dict[str, Any]:
    """The JSON of the task with one part replaced."""
    data: Any = json.loads(json.dumps(task_to_json(parse_task(TEXT))))
    place = data
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = to
    return data


def nested(depth: int) -> Any:
    expression: Any = "x"
    for _ in range(depth):
        expression = ["-", expression]
    return expression


PREDICATE = ("requirements", 0, "predicate")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ([], "task must be an object, got an array."),
        ({}, "task lacks the key 'format'."),
        ({"fromat": 1}, "task has the unknown key 'fromat'. Did you mean 'format'?"),
        ({5: 1}, "task has the unknown key 5."),
        (changed("format", to=2), "this task has JSON format 2, and this version of hprs reads 1."),
        (changed("format", to=True), "this task has JSON format True"),
        (changed("signals", to="x"), "task.signals must be an array, got 'x'."),
        (changed("signals", 0, to=3), "task.signals[0] must be an object, got 3."),
        (
            changed("signals", 0, "name", to=None),
            "task.signals[0].name must be a string, got None.",
        ),
        (changed("signals", 0, "unit", to=7), "task.signals[0].unit must be a string, got 7."),
        (changed("signals", 0, "length", to=2.5), "length must be a whole number, got 2.5."),
        (changed("signals", 0, "length", to=True), "length must be a whole number, got True."),
        (
            changed("signals", 0, "source", "index", to=[1]),
            "index must be a whole number or an array of two, got an array.",
        ),
        (changed("signals", 0, "source", "root", to="env"), "a source reads obs"),
        (changed("signals", 0, "source", "index", to=10**400), "below 10 ** 9, got a huge number"),
        (changed("signals", 0, "length", to=10**5000), "below 10 ** 9, got a huge number"),
        (changed("signals", 0, "low", to=-1), "low must be a finite number that is not negative"),
        (changed("signals", 0, "low", to=float("nan")), "not negative, got nan."),
        (changed("signals", 0, "low", to=10**400), "not negative, got a huge number."),
        (changed("signals", 0, "low", to=False), "must be a number, a name or an array"),
        (changed("signals", 0, "low", to={}), "a number, a name or an array, got an object."),
        (changed("signals", 0, "low", to=[]), "must be an operator or a function"),
        (changed("signals", 0, "low", to=[["-"], 1]), "must be an operator or a function"),
        (changed("signals", 0, "low", to=["-"]), "must be an operator or a function"),
        (changed("signals", 0, "low", to=["eval", "x"]), "must be an operator or a function"),
        (changed("signals", 0, "low", to=["abs"]), "abs() takes 1 argument, got 0."),
        (changed("signals", 0, "low", to=nested(95)), "'x' is used before"),
        (changed("signals", 0, "low", to=nested(20_000)), "is nested deeper than 100 levels."),
        (changed("signals", 0, "low", to="y" * 200), f"unknown name '{'y' * 200}'."),
        (changed("definitions", 0, "low", to=None), "the range of 'd' needs both ends."),
        (changed(*PREDICATE, to="x"), "predicate must be an array, got 'x'."),
        (changed(*PREDICATE, to=[]), "must be a relation with two sides"),
        (changed(*PREDICATE, to=["==", "x", 1]), "must be a relation with two sides"),
        (changed(*PREDICATE, to=["<=", "x", 1, 2]), "must be a relation with two sides"),
        (changed(*PREDICATE, to=["and"]), "and / or need at least two parts."),
        (changed(*PREDICATE, to=["<=", ["<=", "x", 1], 1]), "must be an operator or a function"),
        (
            changed("requirements", 0, "kind", to="always"),
            "kind must be one of ensure, achieve, conquer, encourage, got 'always'.",
        ),
        (changed("requirements", 0, "kind", to=["ensure"]), "must be one of ensure"),
        (changed("preferences", 0, "higher", to="x" * 100), f"requirement '{'x' * 100}'"),
        (changed("preferences", 0, "higher", to=list(range(50))), "must be a string, got an array"),
        (changed("preferences", 0, "higher", to=b"x" * 99), "must be a string, got b'xxx"),
    ],
    ids=lambda value: value[:40] if isinstance(value, str) else "",
)
def test_malformed_data_are_named_with_their_place(data: object, message: str) -> None:
    with pytest.raises(SpecError) as caught:
        task_from_json(data)
    assert message in str(caught.value)


def test_nested_conjunctions_are_flattened_as_in_the_text() -> None:
    data = changed(*PREDICATE, to=["and", ["and", ["<=", "x", 1], ["<=", "x", 2]], ["<=", "d", 1]])
    assert task_from_json(data) == task_from_json(
        changed(*PREDICATE, to=["and", ["<=", "x", 1], ["<=", "x", 2], ["<=", "d", 1]])
    )


def test_what_cannot_be_meant_is_refused_as_in_a_text() -> None:
    with pytest.raises(SpecValidationError, match="unknown name 'z'"):
        task_from_json(changed(*PREDICATE, to=["<=", "z", 1]))
