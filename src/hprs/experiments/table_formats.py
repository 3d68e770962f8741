"""Tables as CSV, LaTeX and data of a page."""

from __future__ import annotations

import csv
import io
import re
from typing import Any

import numpy as np

from hprs.experiments.tables import Cell, Table

_SPECIAL = re.compile(r"[\\{}$&#%_^~±<>]")
_LATEX = {
    "\\": r"\textbackslash{}",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "±": r"$\pm$",
    "<": r"$<$",
    ">": r"$>$",
}
_DIGITS = 6
"""Significant ones of a number in a CSV file."""


def to_csv(table: Table) -> str:
    """The table as CSV: numbers as such, and what is more than a number as it is shown."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table.header)
    writer.writerows([_plain(cell) for cell in row] for row in table.rows)
    return text.getvalue()


def to_latex(table: Table) -> str:
    """The table as a LaTeX `table`, for the package booktabs."""
    columns = "l" + "r" * (len(table.header) - 1)
    lines = [
        r"\begin{table}",
        r"\centering",
        rf"\caption{{{_escaped(' '.join((table.title + '.', *table.notes)))}}}",
        rf"\begin{{tabular}}{{{columns}}}",
        r"\toprule",
        " & ".join(_escaped(name) for name in table.header) + r" \\",
        r"\midrule",
        *(" & ".join(_cell(cell) for cell in row) + r" \\" for row in table.rows),
        r"\bottomrule",
        r"\end{tabular}",
        r"\end{table}",
    ]
    return "\n".join(lines) + "\n"


def to_page(table: Table) -> dict[str, Any]:
    """The table as data of a page: of each cell its text, what it is sorted by, and its weight."""
    return {
        "name": table.name,
        "title": table.title,
        "header": list(table.header),
        "rows": [
            [[cell.text, _sortable(cell), int(cell.bold)] for cell in row] for row in table.rows
        ],
        "notes": list(table.notes),
    }


def _plain(cell: Cell) -> str:
    if cell.value is None or not re.fullmatch(r"[-\d.,]+", cell.text):
        return cell.text
    return f"{cell.value:.{_DIGITS}g}"


def _cell(cell: Cell) -> str:
    text = _escaped(cell.text)
    return rf"\textbf{{{text}}}" if cell.bold else text


def _escaped(text: str) -> str:
    return _SPECIAL.sub(lambda found: _LATEX.get(found[0], "\\" + found[0]), text)


def _sortable(cell: Cell) -> float | str | None:
    """A number, words, or nothing, which comes last."""
    if cell.value is None:
        return cell.text or None
    # JSON has no infinity.
    return None if np.isnan(cell.value) else float(np.clip(cell.value, -1e308, 1e308))
