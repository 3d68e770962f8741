"""What a benchmark is trained with where the user says nothing: a TOML file beside it.

```
steps = 300_000         # environment steps of a training
algorithm = "ppo"       # the algorithm taken by default
[ppo]                   # one table an algorithm: the hyper-parameters tuned for it
n_steps = 128
```
"""

from __future__ import annotations

import sys
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from hprs.errors import UsageError, did_you_mean


@dataclass(frozen=True)
class Tuning:
    """The content of such a file."""

    path: str
    """The file's name, for messages."""
    steps: int
    """Environment steps of a training that suffices."""
    algorithm: str
    """The algorithm taken by default."""
    tables: Mapping[str, Mapping[str, Any]]
    """Algorithm to its hyper-parameters."""


def parse_tuning(text: str, *, path: str, algorithms: Collection[str]) -> Tuning:
    """Read a tuning file.

    Args:
        text: Its text.
        path: Its name, for messages.
        algorithms: The algorithms that exist.

    Raises:
        UsageError: It is no TOML, lacks a key, or has one that is unknown or of the wrong type.
    """
    content = _parse_toml(text, path)
    known = ("steps", "algorithm", *algorithms)
    for key in content:
        if key not in known:
            raise UsageError(
                f"{path}: unknown key '{key}'.{did_you_mean(key, known)}"
                f" It may hold {', '.join(known)}."
            )
    steps, algorithm = content.pop("steps", None), content.pop("algorithm", None)
    if type(steps) is not int or steps < 1:
        raise UsageError(f"{path}: 'steps' must be a whole number from 1 on, got {steps!r}.")
    if algorithm not in algorithms:
        raise UsageError(
            f"{path}: 'algorithm' must be one of {', '.join(algorithms)}, got {algorithm!r}."
        )
    for name, table in content.items():
        if not isinstance(table, dict):
            raise UsageError(f"{path}: '{name}' must be a table: [{name}] on a line of its own.")
    return Tuning(path, steps, algorithm, content)


def _parse_toml(text: str, path: str) -> dict[str, Any]:
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib  # pyright: ignore[reportMissingImports]
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{path}: it is no TOML: {error}") from None
