"""The examples of docs/wrappers.md run."""

from __future__ import annotations

import re
from pathlib import Path

import hprs.wrappers

PAGE = (Path(__file__).parents[2] / "docs" / "wrappers.md").read_text("utf-8")


def test_the_examples_of_the_page_run():
    examples = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert examples
    for example in examples:
        exec(compile(example, "docs/wrappers.md", "exec"), {})


def test_the_page_names_every_wrapper():
    assert all(f".{name}(" in PAGE for name in hprs.wrappers.__all__)
