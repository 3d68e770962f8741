"""The one module that reads and writes run directories.

```
<out>/<environment>/<reward>-<algorithm>-<digest>/seed-<n>/
    run.json          configuration with the task, versions, commit, machine
    evaluations.csv   one row an evaluation episode
    checkpoint/       what a training needs to go on
    policy/last/      the newest evaluated policy
    policy/best/      the evaluated policy with the highest mean PAM
    events.*          TensorBoard
```

Nothing is parsed out of a path. A folder is replaced as a whole: written under a temporary name,
then renamed, so that whatever kills the process leaves the old one or the new one.
"""

from __future__ import annotations

import csv
import io
import json
import os
import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

from hprs.errors import RunError, did_you_mean
from hprs.spec.json_format import task_to_json
from hprs.spec.task import Task
from hprs.training.configuration import Configuration
from hprs.training.evaluation import Episode
from hprs.training.provenance import provenance

FORMAT = 1
RUN_FILE, EVALUATIONS_FILE, CHECKPOINT = "run.json", "evaluations.csv", "checkpoint"
FIXED_COLUMNS = ("step", "seed", "length", "return", "pam", "safe", "target")

Which: TypeAlias = Literal["last", "best"]
WHICH: tuple[Which, ...] = get_args(Which)
"""The policies that a run keeps."""


@dataclass(frozen=True)
class RunDirectory:
    """A training's folder."""

    path: Path

    @cached_property
    def configuration(self) -> Configuration:
        """What was trained.

        Raises:
            RunError: `run.json` cannot be read.
        """
        file = self.path / RUN_FILE
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise RunError(f"{file} cannot be read: {error}") from None
        if not isinstance(content, dict) or content.get("format") != FORMAT:
            raise RunError(f"{file} is not of format {FORMAT}; it needs another version of hprs.")
        try:
            return Configuration.from_json(content["configuration"])
        except (RunError, KeyError) as error:
            raise RunError(f"{file} cannot be used: {error}") from None

    @property
    def events(self) -> Path:
        """The folder of TensorBoard's files."""
        return self.path

    def append(self, step: int, episodes: Sequence[Episode]) -> None:
        """Add an evaluation's rows, all or (killed meanwhile) a part that `truncate` removes."""
        text = _rows(self.configuration.task, step, episodes)
        with (self.path / EVALUATIONS_FILE).open("a", encoding="utf-8", newline="") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())

    def evaluations(self) -> list[dict[str, float]]:
        """All complete rows of `evaluations.csv`, as numbers.

        Raises:
            RunError: The file cannot be read.
        """
        file = self.path / EVALUATIONS_FILE
        try:
            text = file.read_text(encoding="utf-8")
            whole = text[: text.rfind("\n") + 1]
            return [
                {name: float(value) for name, value in row.items()}
                for row in csv.DictReader(io.StringIO(whole))
            ]
        except (OSError, ValueError, TypeError) as error:
            raise RunError(f"{file} cannot be read: {error}") from None

    def truncate(self, step: int) -> None:
        """Keep only evaluations up to a step: later ones will be made again."""
        file = self.path / EVALUATIONS_FILE
        header, *rows = file.read_text(encoding="utf-8").splitlines(keepends=True)
        kept = [row for row in rows if row.endswith("\n") and int(row.split(",", 1)[0]) <= step]
        _write_file(file, header + "".join(kept))

    @contextmanager
    def replacing(self, name: str) -> Iterator[Path]:
        """A new empty folder that takes the place of `name` when the block ends without error."""
        target = self.path / name
        fresh, old = _beside(target, "new"), _beside(target, "old")
        for left_over in (fresh, old):
            shutil.rmtree(left_over, ignore_errors=True)
        fresh.mkdir(parents=True)
        yield fresh
        _sync(fresh)
        if target.exists():
            target.rename(old)
        fresh.rename(target)
        shutil.rmtree(old, ignore_errors=True)

    def checkpoint(self) -> Path | None:
        """The folder of the newest complete checkpoint, if there is one."""
        return _complete(self.path / CHECKPOINT)

    def replacing_policy(self, which: Which) -> Any:
        """`replacing` for one of the kept policies."""
        return self.replacing(f"policy/{which}")

    def policy(self, which: Which = "last") -> Path:
        """The folder of a kept policy.

        Raises:
            RunError: The training has not got that far.
        """
        found = _complete(self.path / "policy" / which)
        if found is None:
            raise RunError(f"{self.path} has no {which} policy yet.")
        return found


def folder_of(configuration: Configuration, out: Path) -> Path:
    """Where a training with this configuration belongs, without its seed."""
    environment = re.sub(r"[^A-Za-z0-9._-]", "-", configuration.environment)
    name = f"{configuration.reward}-{configuration.algorithm}-{configuration.digest}"
    return out / environment / name


def create_runs(configurations: Sequence[Configuration], out: Path) -> list[RunDirectory]:
    """New run directories, one a seed; none if one of them exists.

    Raises:
        RunError: One exists already; the message says how to resume it.
    """
    paths = [folder_of(c, out) / f"seed-{c.seed}" for c in configurations]
    for path in paths:
        if path.exists():
            shown = path if len(paths) == 1 else path.parent
            raise RunError(
                f"{path} exists already. Go on with it: hprs train --resume {shown} "
                "(or choose another seed, or another folder with --out)."
            )
    return [_create(c, path) for c, path in zip(configurations, paths, strict=True)]


def find_runs(path: Path) -> list[RunDirectory]:
    """The run in a folder, or all the seeds below it, by seed.

    Raises:
        RunError: There is no run there, or there are runs of different configurations.
    """
    if (path / RUN_FILE).exists():
        return [RunDirectory(path)]
    if not path.is_dir():
        raise RunError(f"there is no run '{path}'.{did_you_mean(path.name, _near(path))}")
    runs = [RunDirectory(file.parent) for file in sorted(path.glob(f"*/{RUN_FILE}"))]
    if not runs:
        below = sorted({file.parent.parent for file in path.glob(f"**/{RUN_FILE}")})
        hint = f" There are runs in {', '.join(map(str, below[:3]))}." if below else ""
        raise RunError(f"'{path}' is not a run: it holds no {RUN_FILE}.{hint}")
    if len({run.configuration.digest for run in runs}) > 1:
        raise RunError(f"the runs in '{path}' differ in more than the seed; name one of them.")
    return sorted(runs, key=lambda run: run.configuration.seed)


def columns(task: Task) -> list[str]:
    """The header of a task's `evaluations.csv`."""
    return [*FIXED_COLUMNS, *(f"{r.kind}.{r.label}" for r in task.requirements)]


def _create(configuration: Configuration, path: Path) -> RunDirectory:
    content = {
        "format": FORMAT,
        "configuration": configuration.to_json(),
        "task": task_to_json(configuration.task),
        **provenance(),
    }
    path.mkdir(parents=True)
    _write_file(path / EVALUATIONS_FILE, ",".join(columns(configuration.task)) + "\n")
    _write_file(path / RUN_FILE, json.dumps(content, indent=2) + "\n")
    return RunDirectory(path)


def _rows(task: Task, step: int, episodes: Sequence[Episode]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for episode in episodes:
        found = episode.assessment
        writer.writerow(
            [
                step,
                episode.seed,
                found.length,
                repr(episode.total),
                repr(float(found.pam)),
                int(found.safe),
                int(found.target),
                *(_cell(found.requirements, label) for label in task.labels),
            ]
        )
    return text.getvalue()


def _cell(requirements: Mapping[str, Any], label: str) -> str:
    value = requirements[label]
    return str(int(value)) if isinstance(value, bool) else repr(float(value))


def _beside(path: Path, state: str) -> Path:
    return path.with_name(f".{path.name}.{state}")


def _complete(path: Path) -> Path | None:
    """A replaced folder; the old one if the process died between the two renames."""
    return next((p for p in (path, _beside(path, "old")) if p.is_dir()), None)


def _near(path: Path) -> list[str]:
    folder = path.parent
    return [other.name for other in folder.iterdir()] if folder.is_dir() else []


def _write_file(path: Path, text: str) -> None:
    fresh = path.with_name(f".{path.name}.new")
    with fresh.open("w", encoding="utf-8", newline="") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    fresh.replace(path)


def _sync(folder: Path) -> None:
    for path in folder.rglob("*"):
        if path.is_file():
            with path.open("rb") as file:
                os.fsync(file.fileno())
