"""How the command line prints: tables and numbers."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable, Sequence
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

WIDE = 120
"""Columns of output that goes to a file, where nothing can be known of the reader's."""


def console(*, stderr: bool = False) -> Console:
    """A console that neither interprets users' text nor breaks lines in files."""
    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() else WIDE
    return Console(file=stream, width=width, markup=False, highlight=False, emoji=False)


def print_table(
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    title: str = "",
    numbers_from: int = 1,
    breaks: Sequence[int] = (),
) -> None:
    """Print a table.

    Args:
        columns: The header.
        rows: The cells.
        title: A line above it.
        numbers_from: The first column that holds numbers; these are aligned to the right.
        breaks: The rows after which a line is drawn.
    """
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for index, column in enumerate(columns):
        table.add_column(Text(column), justify="right" if index >= numbers_from else "left")
    for index, row in enumerate(rows):
        table.add_row(*(Text(cell) for cell in row), end_section=index in breaks)
    out = console()
    if title:
        out.print(title)
        out.print()
    out.print(table)


def print_json(content: Any) -> None:
    """Print a JSON value; infinities, which JSON does not know, become null."""
    print(json.dumps(_finite(content), indent=2))


def _finite(content: Any) -> Any:
    if isinstance(content, dict):
        return {key: _finite(value) for key, value in content.items()}
    if isinstance(content, list):
        return [_finite(value) for value in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content


def decimals(value: float) -> str:
    """A measure with three decimals."""
    return f"{value:.3f}"


def interval(low: float, high: float) -> str:
    """A confidence interval."""
    return f"[{low:.3f}, {high:.3f}]"


def plural(count: int, noun: str) -> str:
    """A count with its noun."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"
