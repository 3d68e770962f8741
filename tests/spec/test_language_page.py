from __future__ import annotations

import re
from pathlib import Path

import pytest

from hprs.errors import SpecError
from hprs.spec import parser, task_file
from hprs.spec.expression import MAX_DEPTH
from hprs.spec.parser import parse_task
from hprs.spec.task import MAX_REQUIREMENTS, Task
from hprs.spec.vocabulary import FUNCTIONS, KEYWORDS

PAGE = (Path(__file__).parents[2] / "docs" / "language.md").read_text("utf-8")


def examples(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("text", examples("hprs"))
def test_every_example_is_a_task_without_remarks_but_a_missing_target(text: str) -> None:
    remarks = [r.message for r in parse_task(text).remarks if "has no target" not in r.message]
    assert remarks == []


def test_the_example_in_python_runs_and_is_a_task() -> None:
    (code,) = examples("python")
    names: dict[str, object] = {}
    exec(code, names)
    assert isinstance(names["task"], Task)


def test_the_example_of_an_error_is_what_is_said() -> None:
    (message,) = examples("text")
    text = 'signal theta in [0, 1] "rad"\n' + "\n" * 5 + "ensure pole_up: abs(thetta) <= 12 deg\n"
    with pytest.raises(SpecError) as caught:
        parse_task(text, path="cart.hprs")
    assert f"{caught.value}\n" == message


def test_every_function_and_keyword_is_on_the_page() -> None:
    for word in (*FUNCTIONS, *(KEYWORDS - {"not"})):
        assert re.search(rf"`[^`\n]*\b{word}\b[^`\n]*`", PAGE), word


def test_the_limits_on_the_page_are_those_of_the_code() -> None:
    for limit in (
        f"{task_file.MAX_BYTES:,} bytes",
        f"{parser.MAX_WORDS:,} words",
        f"{MAX_REQUIREMENTS} requirements",
        f"{MAX_REQUIREMENTS} preferences",
        f"{parser.MAX_BRACKETS} nested brackets",
        f"most {MAX_DEPTH}\nlevels",
        f"{parser.MAX_NAME} characters",
        f"a number {parser.MAX_DIGITS}",
    ):
        assert limit in PAGE, limit
