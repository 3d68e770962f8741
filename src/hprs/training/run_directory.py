"""The one module that reads and writes run directories.

```
<out>/<environment>/<reward>-<algorithm>-<digest>/seed-<n>/
    run.json          configuration with the task, versions, commit, machine
    evaluations.csv   one row an evaluation episode
    checkpoint/       what a training needs to go on
    replay/           its replay buffer, in segments
    policy/last/      the newest evaluated policy
    policy/best/      the evaluated policy with the highest mean PAM
    events.*          TensorBoard
<out>/<environment>/population-<digest>.json
                      runs that were started together
```

Nothing is parsed out of a path. A folder is replaced as a whole: written under a temporary name,
then renamed, so that whatever kills the process leaves the old one or the new one. An evaluation is
recorded with its checkpoint first, then in the table, then as policies; opening a run to train it
does what a kill has left undone.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

from hprs.errors import RunError, did_you_mean
from hprs.spec.json_format import task_to_json
from hprs.training import evaluation_table, files
from hprs.training.checkpoint import Checkpoint
from hprs.training.configuration import Configuration
from hprs.training.lock import locked
from hprs.training.population_file import is_population, read_population
from hprs.training.provenance import provenance, versions
from hprs.training.replay import Ring, prune, write_segments

FORMAT = 3
"""Format 1 had no `environment_options`, and checkpoints that only approximately went on. Those of
format 2 do not count evaluations, and know only the end of a running episode."""

RUN_FILE, EVALUATIONS_FILE, CHECKPOINT, REPLAY = (
    "run.json", "evaluations.csv", "checkpoint", "replay"
)  # fmt: skip
POLICY_FILE = "policy.json"

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
        content = self._content
        try:
            found = dict(content["configuration"])
            if content["format"] == 1:
                found["environment_options"] = {}
            # Younger than format 3, and absent where there was nothing to say.
            found.setdefault("reward_options", {})
            found.setdefault("trainer", "sb3")
            return Configuration.from_json(found)
        except (RunError, KeyError, TypeError, ValueError) as error:
            raise RunError(f"{self.path / RUN_FILE} cannot be used: {error}") from None

    @cached_property
    def _content(self) -> dict[str, Any]:
        file = self.path / RUN_FILE
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise RunError(f"{file} cannot be read: {error}") from None
        found = content.get("format") if isinstance(content, dict) else None
        if found not in range(1, FORMAT + 1):
            writer = _writer(content)
            raise RunError(
                f"{file} is of format {found}, written by {writer}; this hprs reads formats 1 to "
                f"{FORMAT}. Use it with {writer}."
            )
        return content

    @property
    def versions(self) -> dict[str, str]:
        """What it was made with: package to version."""
        return dict(self._content.get("versions", {}))

    @property
    def changed_versions(self) -> list[str]:
        """What can change numbers and is of another version than when the run was made."""
        now, then = versions(), self.versions
        return [
            f"{package} {then[package]} (now {now[package]})"
            for package in now
            if package in then and then[package] != now[package]
        ]

    @property
    def origin(self) -> dict[str, Any]:
        """Versions and commit that the run was made with, as far as they are recorded."""
        return {
            name: self._content[name] for name in ("versions", "commit") if name in self._content
        }

    @property
    def replay(self) -> Path:
        """The folder of the replay buffer's segments."""
        return self.path / REPLAY

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Turn a full or read-only disk into one line; see `files.writing`."""
        with files.writing(self.path, self._advice):
            yield

    @property
    def _advice(self) -> str:
        return f" What is recorded is safe; go on with: hprs train --resume {self.path}"

    @contextmanager
    def locked(self, *, patience: float = 0.0) -> Iterator[None]:
        """Keep other processes from training here; the lock vanishes with the process.

        Args:
            patience: Seconds to wait for another process to leave.

        Raises:
            RunError: Another process trains here, or the folder cannot be written.
        """
        with locked(self.path, self._advice, patience=patience):
            yield

    @property
    def has_begun(self) -> bool:
        """Whether a training has recorded anything here."""
        return (
            files.complete(self.path / CHECKPOINT) is not None
            or any(files.complete(self.path / "policy" / which) for which in WHICH)
            or not evaluation_table.is_empty(self.path / EVALUATIONS_FILE)
        )

    def open(self, notice: Callable[[str], None] = lambda text: None) -> Checkpoint | None:
        """The newest checkpoint, once the run's other files agree with it.

        Args:
            notice: Told in one line what is not as it was left, and does not stop the training.

        Raises:
            RunError: The checkpoint is missing, damaged or of another version.
        """
        checkpoint = self.checkpoint()
        if checkpoint is None:
            if self.has_begun:
                raise self.cannot_go_on(RunError(f"{self.path / CHECKPOINT} is missing."))
            return None
        progress, table = checkpoint.progress, self.path / EVALUATIONS_FILE
        with self.writing():
            rows = evaluation_table.repair(table, progress.step, checkpoint.rows)
        recorded = progress.evaluations * self.configuration.evaluation_episodes
        if rows != recorded:
            notice(f"{table} is not what was recorded: it has {rows} of {recorded} rows.")
        return checkpoint

    def checkpoint(self) -> Checkpoint | None:
        """The newest complete checkpoint, if there is one.

        Raises:
            RunError: It is damaged, or the run of another version.
        """
        if self._content["format"] != FORMAT:
            raise RunError(
                f"{self.path} was written by {_writer(self._content)} in format "
                f"{self._content['format']}, whose checkpoints this hprs cannot go on with. Its "
                "policies can be evaluated; to train longer, train anew."
            )
        folder = files.complete(self.path / CHECKPOINT)
        if folder is None:
            return None
        try:
            return Checkpoint.load(folder)
        except RunError as error:
            raise self.cannot_go_on(error) from None

    def cannot_go_on(self, error: RunError) -> RunError:
        """The error of a damaged checkpoint, with what is left and what to do."""
        return RunError(
            f"{error} This training cannot go on; its evaluations and policies are untouched "
            f"(hprs evaluate {self.path}). To train anew, choose another folder with --out."
        )

    def save(
        self, checkpoint: Checkpoint, *, evaluated: bool, ring: Ring | None = None
    ) -> Checkpoint:
        """Commit a checkpoint, and the rows of its evaluation if that is new.

        Args:
            checkpoint: Of a replay buffer it names the segments that the last one named.
            evaluated: Whether its evaluation is new.
            ring: The replay buffer.

        Returns:
            The checkpoint with the segments that hold the replay buffer now.

        Raises:
            RunError: It cannot be written; the last checkpoint is still whole then.
        """
        with self.writing():
            if ring is not None:
                segments = write_segments(self.replay, ring, checkpoint.segments)
                checkpoint = replace(checkpoint, segments=segments)
            with files.replacing(self.path / CHECKPOINT) as folder:
                checkpoint.save(folder)
            if evaluated:
                files.append(self.path / EVALUATIONS_FILE, checkpoint.rows.encode())
            if ring is not None:
                prune(self.replay, checkpoint.segments)
        return checkpoint

    def evaluations(self) -> list[dict[str, float]]:
        """All complete rows of `evaluations.csv`, as numbers.

        Raises:
            RunError: The file cannot be read.
        """
        return evaluation_table.read(self.path / EVALUATIONS_FILE)

    def evaluation_columns(self) -> evaluation_table.Columns:
        """The same, an array a column: faster where there are many runs."""
        return evaluation_table.read_columns(self.path / EVALUATIONS_FILE)

    def save_policy(self, which: Which, *, trainer: str, step: int, name: str, data: bytes) -> None:
        """Keep a policy.

        Args:
            which: As which one.
            trainer: Whose format its file has.
            step: The step of the training at which it was evaluated.
            name: The file's name.
            data: The file's content.
        """
        content = {"trainer": trainer, "step": step, "file": name, "sha256": files.checksum(data)}
        with self.writing(), files.replacing(self.path / "policy" / which) as folder:
            files.write(folder / name, data)
            files.write(folder / POLICY_FILE, (json.dumps(content) + "\n").encode())

    def policy(self, which: Which = "last") -> Path:
        """The folder of a kept policy.

        Raises:
            RunError: The training has not got that far.
        """
        found = files.complete(self.path / "policy" / which)
        if found is None:
            raise RunError(f"{self.path} has no {which} policy yet.")
        return found

    def policy_step(self, which: Which) -> int:
        """The step at which a kept policy was evaluated; -1 if there is none."""
        found = files.complete(self.path / "policy" / which)
        try:
            return -1 if found is None else int(_policy_content(found)["step"])
        except (RunError, KeyError, TypeError, ValueError):
            return -1

    def policy_file(self, which: Which) -> Path:
        """The file of a kept policy, checked.

        Raises:
            RunError: There is none, or it is damaged.
        """
        folder = self.policy(which)
        content = _policy_content(folder)
        try:
            file = folder / content["file"]
            # Format 1 kept no checksums of policies.
            sha256 = content.get("sha256") or files.checksum(files.read(file))
        except (KeyError, TypeError, AttributeError):
            raise files.damaged(folder / POLICY_FILE) from None
        files.read_checked(file, sha256)
        return file


def folder_of(configuration: Configuration, out: Path) -> Path:
    """Where a training with this configuration belongs, without its seed."""
    environment = re.sub(r"[^A-Za-z0-9._-]", "-", configuration.environment)
    name = f"{configuration.reward}-{configuration.algorithm}-{configuration.digest}"
    return out / environment / name


def create_runs(configurations: Sequence[Configuration], out: Path) -> list[RunDirectory]:
    """New run directories, one a seed; none if one of them has begun.

    A process that dies while it makes them leaves some that have not: they are made anew.

    Raises:
        RunError: One has begun; the message says how to resume it. Or it cannot be written.
    """
    runs = [RunDirectory(folder_of(c, out) / f"seed-{c.seed}") for c in configurations]
    for run in runs:
        _refuse_begun(run, several=len(runs) > 1)
    for run, configuration in zip(runs, configurations, strict=True):
        _create(run, configuration, several=len(runs) > 1)
    return runs


def _refuse_begun(run: RunDirectory, *, several: bool) -> None:
    if (run.path / RUN_FILE).exists() and run.has_begun:
        shown = run.path.parent if several else run.path
        raise RunError(
            f"{run.path} exists already. Go on with it: hprs train --resume {shown} "
            "(or choose another seed, or another folder with --out)."
        )


def find_runs(path: Path, *, mixed: bool = False) -> list[RunDirectory]:
    """The run in a folder, all the seeds below it, or the members of a population.

    Args:
        path: A run directory, the folder of its seeds, or a population's file.
        mixed: Whether they may differ in more than the seed.

    Raises:
        RunError: There is no run there, or there are runs of different configurations.
    """
    if (path / RUN_FILE).exists():
        return [RunDirectory(path)]
    runs = _members(path) if is_population(path) else _seeds(path)
    folders = {run.configuration.digest: run.path.parent for run in runs}
    if len(folders) > 1 and not mixed:
        shown = ", ".join(str(folder) for folder in folders.values())
        raise RunError(
            f"the runs in '{path}' differ in more than the seed; name one of them: {shown}."
        )
    return runs if mixed else sorted(runs, key=lambda run: run.configuration.seed)


def _members(path: Path) -> list[RunDirectory]:
    runs = [RunDirectory(member) for member in read_population(path)]
    gone = [str(run.path) for run in runs if not (run.path / RUN_FILE).exists()]
    if gone or not runs:
        raise RunError(
            f"{path} lists {', '.join(gone) or 'no run'}, and there is no {RUN_FILE}. "
            "Take it from the list."
        )
    return runs


def _seeds(path: Path) -> list[RunDirectory]:
    if not path.is_dir():
        raise RunError(f"there is no run '{path}'.{did_you_mean(path.name, _near(path))}")
    runs = [RunDirectory(file.parent) for file in sorted(path.glob(f"*/{RUN_FILE}"))]
    if not runs:
        below = sorted({file.parent.parent for file in path.glob(f"**/{RUN_FILE}")})
        hint = f" There are runs in {', '.join(map(str, below[:3]))}." if below else ""
        raise RunError(f"'{path}' is not a run: it holds no {RUN_FILE}.{hint}")
    return runs


def _create(run: RunDirectory, configuration: Configuration, *, several: bool) -> None:
    content = {
        "format": FORMAT,
        "configuration": configuration.to_json(),
        "task": task_to_json(configuration.task),
        **provenance(),
    }
    header = evaluation_table.header(configuration.task)
    with files.writing(run.path):
        run.path.mkdir(parents=True, exist_ok=True)
    with locked(run.path), files.writing(run.path):
        # Another process may have made it, and trained, since it was looked at.
        _refuse_begun(run, several=several)
        files.replace(run.path / EVALUATIONS_FILE, header.encode())
        files.replace(run.path / RUN_FILE, (json.dumps(content, indent=2) + "\n").encode())


def _writer(content: Any) -> str:
    """Who wrote a run; where the version does not tell it from this hprs, with the commit."""
    try:
        version = content["versions"]["hprs"]
        same = version == versions().get("hprs") and content.get("commit")
        return f"hprs {version} (commit {content['commit']})" if same else f"hprs {version}"
    except (KeyError, TypeError, AttributeError):
        return "another version of hprs"


def _policy_content(folder: Path) -> Any:
    file = folder / POLICY_FILE
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise RunError(f"{file} cannot be read: {error}") from None


def _near(path: Path) -> list[str]:
    folder = path.parent
    return [other.name for other in folder.iterdir()] if folder.is_dir() else []
