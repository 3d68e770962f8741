"""Centre lines of tracks as CSV, as f1tenth_racetracks and spreadsheets write it."""

from __future__ import annotations

from itertools import takewhile
from pathlib import Path

import numpy as np

from hprs.carsim.geometry import Points
from hprs.errors import TrackError


def read_centre_line(path: Path) -> Points:
    """The points of a centre line's file, (P, 2).

    Raises:
        TrackError: It cannot be read, its columns cannot be told, or the line is not closed.
    """
    try:
        # Spreadsheets begin a file with a byte order mark.
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise TrackError(f"{path}: cannot be read: {error.strerror}.") from None
    except UnicodeDecodeError:
        raise TrackError(f"{path}: is not text; expected CSV with the columns x_m, y_m.") from None
    points = _rows_to_points([(number, _cells(line)) for number, line in enumerate(lines, 1)], path)
    if len(points) < 8:
        raise TrackError(f"{path}: holds {len(points)} points; a closed centre line needs 8.")
    if np.array_equal(points[0], points[-1]):
        points = points[:-1]
    gaps = np.hypot(*(np.roll(points, -1, axis=0) - points).T)
    if gaps[-1] > 10 * np.median(gaps):
        raise TrackError(
            f"{path}: is not closed: its last point is {gaps[-1]:.2f} m from its first one."
        )
    return points


def _cells(line: str) -> list[str]:
    cells = [cell.strip(" \t\"'") for cell in line.split(";" if ";" in line else ",")]
    # A separator may end a line.
    return cells if cells[-1] else cells[:-1]


def _rows_to_points(rows: list[tuple[int, list[str]]], path: Path) -> Points:
    """The points of numbered rows, of which some name the columns or are comments."""
    rows = [(number, cells) for number, cells in rows if cells]
    # What stands after the first number is no name of a column.
    heads = [cells for _, cells in takewhile(lambda row: not _has_number(row[1]), rows)]
    rows = [row for row in rows[len(heads) :] if not row[1][0].startswith("#")]
    wide = len(rows[0][1]) if rows else 0
    names, x, y = _columns(heads, wide, path)
    points = []
    for number, cells in rows:
        if names and len(cells) > len(names):
            raise TrackError(
                f"{path}:{number}: has {len(cells)} cells under {len(names)} names of columns. "
                "Are there decimal commas? Write points."
            )
        try:
            points.append((float(cells[x]), float(cells[y])))
        except (ValueError, IndexError):
            commas = any("," in cell for cell in cells)
            raise TrackError(
                f"{path}:{number}: a row lacks a number in the columns {names[x] if names else 1} "
                f"and {names[y] if names else 2}."
                + (" Numbers have decimal commas; write points." if commas else "")
            ) from None
    return np.array(points).reshape(-1, 2)


def _columns(heads: list[list[str]], wide: int, path: Path) -> tuple[list[str], int, int]:
    """Names of the columns, none if the file has none, and which of them are x and y."""
    found: list[str] = []
    for head in heads:
        names = [cell.strip(" #").lower() for cell in head]
        for x, y in (("x_m", "y_m"), ("x", "y")):
            if x in names and y in names:
                return names, names.index(x), names.index(y)
        # Other comments have other numbers of cells.
        if not head[0].startswith("#") or len(head) == wide:
            found = names
    if found and wide:
        raise TrackError(
            f"{path}: names the columns {', '.join(found)}; "
            "a centre line has x_m and y_m, or x and y."
        )
    return [], 0, 1


def _has_number(cells: list[str]) -> bool:
    return not cells[0].startswith("#") and any(map(_is_meant_as_number, cells))


def _is_meant_as_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True
