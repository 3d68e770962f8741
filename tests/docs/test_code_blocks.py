"""Every code block of README.md, CONTRIBUTING.md and docs/ runs, or says why not."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hprs.cli import main
from hprs.experiments.grid import read_grid
from hprs.spec.parser import parse_task
from tests.docs import blocks as documentation
from tests.docs.blocks import EXECUTED, ROOT, SHOWN, Block, all_blocks, blocks_of, not_run, pages
from tests.docs.shell import CAPS, commands_of, furnish, run_command

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

EXECUTABLE = [page for page in pages() if any(block.executed for block in blocks_of(page))]
NOT_RUN = 0
"""Blocks that are not executed, or in part; more of them is a decision."""


# Not seen to pass everywhere yet.
pytestmark = pytest.mark.slow


@pytest.fixture(scope="session")
def trained_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short training, which pages call RUN."""
    out = tmp_path_factory.mktemp("runs")
    assert main(["train", "hprs/CartPole-v0", "--out", str(out), *CAPS["train"]]) == 0
    (run,) = out.rglob("seed-0")
    return run


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory with what the pages speak of."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    furnish(tmp_path)
    return tmp_path


@pytest.mark.parametrize("page", EXECUTABLE, ids=lambda page: str(page.relative_to(ROOT)))
def test_the_blocks_of_the_page_run(
    page: Path, folder: Path, trained_run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names: dict[str, Any] = {"__name__": "page"}
    runners: dict[str, Callable[[Block], None]] = {
        "python": lambda block: run_python(block, names),
        "sh": lambda block: run_shell(block, trained_run),
        "hprs": lambda block: check_task(block),
        "toml": lambda block: check_toml(block, folder),
    }
    for block in blocks_of(page):
        if name := block.rules.get("file"):
            (folder / name).write_text(block.text, "utf-8")
        if block.executed:
            runners[block.language](block)


def run_python(block: Block, names: dict[str, Any]) -> None:
    # The page's line numbers, so that a traceback leads there.
    exec(compile("\n" * block.line + block.text, str(block.page), "exec"), names)


def run_shell(block: Block, run: Path) -> None:
    for words in commands_of(block):
        run_command(words, block, run)


def check_task(block: Block) -> None:
    parse_task(block.text, path=block.place)


def check_toml(block: Block, folder: Path) -> None:
    if "runs" in tomllib.loads(block.text):
        grid = folder / "grid.toml"
        grid.write_text(block.text, "utf-8")
        assert read_grid(grid).blocks


def test_every_block_has_a_language_that_is_executed_or_shown() -> None:
    unknown = [
        f"{block.place}: '{block.language}'"
        for block in all_blocks()
        if block.language not in (*EXECUTED, *SHOWN)
    ]
    assert unknown == []


def test_what_is_not_run_has_a_reason_and_is_counted() -> None:
    found = not_run(all_blocks())
    assert len(found) == NOT_RUN, "\n".join(found)
    assert all(len(line.split()) > 3 for line in found)


def test_a_block_that_fails_names_its_page_and_line(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("one\n\n```python\nassert 1 == 2\n```\n", "utf-8")
    (block,) = documentation.blocks_of(page)
    with pytest.raises(AssertionError) as caught:
        run_python(block, {})
    assert caught.traceback[-1].lineno == 3  # counted from 0: line 4 of the page


def test_rules_are_read_from_the_lines_above_the_fence(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "<!-- file: a.toml -->\n<!-- not run: a reason -->\n```toml\nx = 1\n```\n\n"
        "<!-- not run: too far away -->\n\n```toml\nx = 1\n```\n",
        "utf-8",
    )
    near, far = documentation.blocks_of(page)
    assert near.rules == {"file": "a.toml", "not run": "a reason"} and not near.executed
    assert far.rules == {} and far.executed
