"""What a benchmark is trained with where the user says nothing: a TOML file beside it.

```
steps = 300_000         # environment steps of a training

[ppo]                   # the JAX trainer's hyper-parameters, one table an algorithm
n_steps = 128

[sac]
steps = 1_000_000       # a table may want another number of steps
buffer_size = 300_000

[sb3.sac]               # those of another trainer, Stable-Baselines3
like = "sac"            # all that [sac] says, but for what follows
ent_coef = "auto"
```
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from hprs.errors import UsageError, did_you_mean
from hprs.training.toml_text import parse_toml

OWNER = "jax"
"""The trainer whose tables stand at the top level."""
_LIKE = "like"


@dataclass(frozen=True)
class Tuning:
    """The content of such a file."""

    path: str
    """The file's name, for messages."""
    steps: int
    """Environment steps of a training that suffices."""
    tables: Mapping[str, Mapping[str, Mapping[str, Any]]]
    """Trainer to algorithm to its hyper-parameters, and perhaps `steps`."""

    def table(self, trainer: str, algorithm: str) -> dict[str, Any]:
        """The hyper-parameters tuned for an algorithm; none, where it has no table."""
        return {k: v for k, v in self._table(trainer, algorithm).items() if k != "steps"}

    def steps_of(self, trainer: str, algorithm: str) -> int:
        """Environment steps of a training that suffices for an algorithm."""
        return self._table(trainer, algorithm).get("steps", self.steps)

    def _table(self, trainer: str, algorithm: str) -> Mapping[str, Any]:
        return self.tables.get(trainer, {}).get(algorithm, {})


def parse_tuning(text: str, *, path: str, trainers: Mapping[str, Collection[str]]) -> Tuning:
    """Read a tuning file.

    Args:
        text: Its text.
        path: Its name, for messages.
        trainers: Trainer to the algorithms it offers.

    Raises:
        UsageError: It is no TOML, lacks a key, or has one that is unknown or of the wrong type.
    """
    content = parse_toml(text, path)
    others = [trainer for trainer in trainers if trainer != OWNER]
    _check_keys(content, ["steps", *trainers[OWNER], *others], path)
    steps = _checked_steps(content.pop("steps", None), path)
    tables = {other: _table(content.pop(other, {}), other, path) for other in others}
    for other in others:
        known = [f"{other}.{name}" for name in trainers[other]]
        _check_keys([f"{other}.{name}" for name in tables[other]], known, path)
    tables = {OWNER: content, **tables}
    for trainer, found in tables.items():
        for name, table in found.items():
            key = name if trainer == OWNER else f"{trainer}.{name}"
            if "steps" in _table(table, key, path):
                _checked_steps(table["steps"], path, key)
    return Tuning(path, steps, _inherited(tables, path))


def _inherited(
    tables: Mapping[str, dict[str, dict[str, Any]]], path: str
) -> dict[str, dict[str, dict[str, Any]]]:
    """The tables with what those that they are like say."""
    found = {OWNER: tables[OWNER]}
    for trainer, own in tables.items():
        if trainer == OWNER:
            continue
        found[trainer] = {}
        for name, table in own.items():
            found[trainer][name] = table
            if _LIKE not in table:
                continue
            model = table.pop(_LIKE)
            if model not in tables[OWNER]:
                raise UsageError(
                    f"{path}: '{trainer}.{name}.{_LIKE}' must name a table of the file, "
                    f"{' or '.join(tables[OWNER]) or 'of which there is none'}, got {model!r}."
                )
            found[trainer][name] = {**tables[OWNER][model], **table}
    return found


def _check_keys(found: Iterable[str], known: Collection[str], path: str) -> None:
    for key in found:
        if key not in known:
            raise UsageError(
                f"{path}: unknown key '{key}'.{did_you_mean(key, known)}"
                f" It may hold {', '.join(known)}."
            )


def _checked_steps(steps: Any, path: str, table: str = "") -> int:
    if type(steps) is not int or steps < 1:
        name = f"{table}.steps" if table else "steps"
        raise UsageError(f"{path}: '{name}' must be a whole number from 1 on, got {steps!r}.")
    return steps


def _table(content: Any, name: str, path: str) -> dict[str, Any]:
    if not isinstance(content, dict):
        raise UsageError(f"{path}: '{name}' must be a table: [{name}] on a line of its own.")
    return content
