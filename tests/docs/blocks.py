"""The fenced blocks of the documentation, and what comments above them say of their execution.

A comment of HTML in the lines right above a fence is a rule:

  <!-- not run: REASON -->                    the block is not executed
  <!-- except: COMMAND | COMMAND: REASON -->  those of a shell block that start so are not;
                                              a $ at the end of one stands for the command's end
  <!-- run with: OPTIONS -->                  every `hprs train` of the block gets these as well
  <!-- file: NAME -->                         the block's text is written to this file first

`python tests/docs/blocks.py` lists what is not run, and why.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
EXECUTED = ("python", "sh", "hprs", "toml")
SHOWN = ("text", "diff", "yaml", "{toctree}", "{eval-rst}")
"""Output, excerpts, formats that are not ours, and directives of the site."""

FENCE = re.compile(
    r"^(?P<ticks>`{3,})(?P<language>\S*)\n(?P<text>.*?)^(?P=ticks)[ ]*$", re.M | re.S
)
RULE = re.compile(r"<!-- (not run|except|run with|file): (.*?) -->\n\Z")


@dataclass(frozen=True)
class Block:
    """A fenced block."""

    page: Path
    line: int
    """Of the fence."""
    language: str
    text: str
    rules: Mapping[str, str]

    @property
    def place(self) -> str:
        """Page and line, as errors name it."""
        return f"{self.page.relative_to(ROOT)}:{self.line}"

    @property
    def executed(self) -> bool:
        """Whether anything of it is."""
        return self.language in EXECUTED and "not run" not in self.rules


def pages() -> list[Path]:
    """Every page of the repository's front and of the site, the built one left out."""
    return [
        ROOT / "README.md",
        ROOT / "CONTRIBUTING.md",
        *sorted((ROOT / "docs").rglob("*.md")),
    ]


def blocks_of(page: Path) -> Iterator[Block]:
    """The blocks of a page, in order."""
    text = page.read_text("utf-8")
    for found in FENCE.finditer(text):
        before, rules = text[: found.start()], {}
        while rule := RULE.search(before):
            rules[rule[1]] = rule[2]
            before = before[: rule.start()]
        line = text.count("\n", 0, found.start()) + 1
        yield Block(page, line, found["language"], found["text"], rules)


def all_blocks() -> list[Block]:
    """The blocks of all pages."""
    return [block for page in pages() for block in blocks_of(page)]


def not_run(blocks: list[Block]) -> list[str]:
    """A line for each block of which something is not executed, with the reason."""
    lines = []
    for block in blocks:
        if reason := block.rules.get("not run"):
            lines.append(f"{block.place}: {reason}")
        elif rule := block.rules.get("except"):
            lines.append(f"{block.place}: except {rule}")
    return lines


if __name__ == "__main__":
    found = all_blocks()
    left_out = not_run(found)
    print("\n".join(left_out))
    print(
        f"{sum(block.executed for block in found)} blocks are executed, {len(left_out)} not or in part."
    )
