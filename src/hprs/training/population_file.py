"""The file that lists the members of a population: runs that were started together.

`<out>/<environment>/population-<8 hex digits>.json` names each member by its path from there.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hprs.errors import RunError
from hprs.training import files

FORMAT = 1
PATTERN = "population-*.json"


def is_population(path: Path) -> bool:
    """Whether a path names a population's file, by its name."""
    return path.match(PATTERN) and path.is_file()


def write_population(members: Sequence[Path]) -> Path:
    """List runs of one environment; those of the same members have the same file.

    Args:
        members: The run directories, at `<out>/<environment>/<configuration>/<seed>`.

    Raises:
        RunError: The file cannot be written.
    """
    folder = members[0].parent.parent
    listed = [member.relative_to(folder).as_posix() for member in members]
    digest = hashlib.sha256(json.dumps(sorted(listed)).encode()).hexdigest()[:8]
    path = folder / PATTERN.replace("*", digest)
    content = json.dumps({"format": FORMAT, "members": listed}, indent=2) + "\n"
    with files.writing(path):
        files.replace(path, content.encode())
    return path


def read_population(path: Path) -> list[Path]:
    """The members that a file lists.

    Raises:
        RunError: It cannot be read, is damaged or of another version.
    """
    content = _parse(path)
    if content.get("format") != FORMAT:
        raise RunError(
            f"{path} is of format {content.get('format')}; this hprs reads format {FORMAT}."
        )
    members = content.get("members")
    if not isinstance(members, list) or not all(isinstance(member, str) for member in members):
        raise files.damaged(path)
    return [path.parent / member for member in members]


def population_of(place: Path) -> Path | None:
    """The newest file that lists a run, or a run in a folder; None if there is none.

    Args:
        place: A run directory, or the folder of its seeds.

    Raises:
        RunError: A file beside or above it cannot be read.
    """
    # `..` is no parent of a path such as `.`.
    whole = Path(os.path.abspath(place))  # noqa: PTH100
    around = [f for folder in (whole.parent, whole.parent.parent) for f in folder.glob(PATTERN)]
    found = [file for file in around if _lists(file, whole)]
    newest = max(found, key=lambda file: (file.stat().st_mtime_ns, file.name), default=None)
    if newest is None or place.is_absolute():
        return newest
    return Path(os.path.relpath(newest))


def _lists(file: Path, place: Path) -> bool:
    return any(place in (member, member.parent) for member in read_population(file))


def _parse(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(files.read(path))
    except ValueError:
        raise files.damaged(path) from None
    if not isinstance(content, dict):
        raise files.damaged(path)
    return content
