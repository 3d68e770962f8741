"""What runs have recorded, as arrays; kept in one file, so that it is read from the runs once."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hprs.envs.registration import benchmark_of
from hprs.errors import RunError
from hprs.experiments.statistics import Numbers
from hprs.semantics.assessment import ACCOMPLISHED, SAFE, accomplished_comfort
from hprs.training import files
from hprs.training.configuration import Configuration
from hprs.training.evaluation_table import FIXED_COLUMNS
from hprs.training.event_times import PATTERN, seconds_of
from hprs.training.measures import SUMMARY
from hprs.training.run_directory import EVALUATIONS_FILE, RUN_FILE, RunDirectory

PADDED = "S+T+C padded"
"""S+T+C with comfort counted as violated from the end of an episode up to the horizon."""
_FORMAT = 1
"""Of the kept file; one of another format is read anew."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """The evaluations of a run."""

    run: RunDirectory
    configuration: Configuration
    versions: Mapping[str, str]
    """What it was trained with."""
    episodes: int
    """Of its newest evaluation."""
    steps: Numbers
    """(k,) of the evaluations, at least one."""
    seconds: Numbers
    """(k,) of training up to them; NaN where no times are recorded."""
    means: Mapping[str, Numbers]
    """(k,) over the episodes of an evaluation: S, S+T, S+T+C, PAM, the padded S+T+C, and
    `kind.label` of each requirement."""

    @property
    def is_complete(self) -> bool:
        """Whether it was trained to its end."""
        return bool(self.steps[-1] >= self.configuration.steps)

    @property
    def newest(self) -> dict[str, float]:
        """The means of the newest evaluation: those of the last policy."""
        return {name: float(values[-1]) for name, values in self.means.items()}


def read_run(run: RunDirectory) -> Recorded:
    """What a run has recorded.

    Raises:
        RunError: It cannot be read, or holds no evaluation.
    """
    table = run.evaluation_columns()
    if not len(table["step"]):
        raise RunError(f"{run.path} holds no evaluation yet.")
    steps, where, counts = np.unique(table["step"], return_inverse=True, return_counts=True)
    pam = table["pam"]
    columns: dict[str, Any] = {
        **dict(zip(SUMMARY, _summary(pam), strict=True)),
        PADDED: padded(run.configuration, pam, table["length"]),
        **{name: column for name, column in table.items() if name not in FIXED_COLUMNS},
    }  # fmt: skip
    means = {
        name: np.bincount(where, weights=np.asarray(column, dtype=float)) / counts
        for name, column in columns.items()
    }
    return Recorded(
        run, run.configuration, run.versions, int(counts[-1]), steps,
        seconds_of(run.path, steps), means,
    )  # fmt: skip


class Shelf:
    """Keeps what was read of runs in a file, and reads again what has changed since.

    Args:
        file: Where it is kept.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        self._kept: dict[str, Recorded] = {}
        self._stamps: dict[str, list[int]] = {}
        self._changed = False
        self._load()

    def read(self, run: RunDirectory) -> Recorded:
        """What a run has recorded.

        Raises:
            RunError: It cannot be read, or holds no evaluation.
        """
        key, stamp = str(run.path.resolve()), _stamp(run.path)
        if self._stamps.get(key) != stamp:
            self._kept[key], self._stamps[key] = read_run(run), stamp
            self._changed = True
        return self._kept[key]

    def save(self) -> None:
        """Write the file, if anything is new in it.

        Raises:
            RunError: It cannot be written.
        """
        if not self._changed:
            return
        index: list[Any] = []
        texts: dict[str, int] = {}
        arrays: list[Numbers] = []
        for key, one in self._kept.items():
            content = one.configuration.to_json()
            # A task stands in hundreds of runs.
            content["task_text"] = texts.setdefault(content["task_text"], len(texts))
            index.append(
                [key, self._stamps[key], content, dict(one.versions), one.episodes,
                 len(one.steps), list(one.means)]
            )  # fmt: skip
            arrays += [one.steps, one.seconds, *one.means.values()]
        content = {"format": _FORMAT, "texts": list(texts), "runs": index}
        data = io.BytesIO()
        np.savez(data, index=np.array(json.dumps(content)), values=np.concatenate(arrays))
        with files.writing(self._file):
            files.replace(self._file, data.getvalue())

    def _load(self) -> None:
        try:
            with np.load(io.BytesIO(self._file.read_bytes()), allow_pickle=False) as kept:
                index, values = json.loads(str(kept["index"])), kept["values"]
            if index["format"] != _FORMAT:
                return
            texts, place = index["texts"], 0
            for key, stamp, content, versions, episodes, count, names in index["runs"]:
                content["task_text"] = texts[content["task_text"]]
                rows = values[place : place + count * (2 + len(names))].reshape(-1, count)
                place += rows.size
                self._stamps[key] = stamp
                self._kept[key] = Recorded(
                    RunDirectory(Path(key)), Configuration.from_json(content), versions, episodes,
                    rows[0], rows[1], dict(zip(names, rows[2:], strict=True)),
                )  # fmt: skip
        # It is only a copy: whatever is wrong with it, the runs are read again.
        except (OSError, KeyError, ValueError, TypeError, RunError, zipfile.BadZipFile):
            self._kept, self._stamps = {}, {}


def find_below(folder: Path) -> list[RunDirectory]:
    """All runs in a folder, however deep.

    Raises:
        RunError: There is none.
    """
    if (folder / RUN_FILE).exists():
        return [RunDirectory(folder)]
    runs = [RunDirectory(file.parent) for file in sorted(folder.glob(f"**/{RUN_FILE}"))]
    if not runs:
        what = "holds no run" if folder.is_dir() else "does not exist"
        raise RunError(f"'{folder}' {what}: give the folder that hprs benchmark or train wrote.")
    return runs


def read_all(
    runs: Sequence[RunDirectory],
    shelf: Shelf,
    watch: Callable[[int], None] = lambda count: None,
) -> tuple[list[Recorded], list[str]]:
    """What runs have recorded, and of each that cannot be shown the reason.

    Args:
        runs: The runs.
        shelf: Where what was read is kept.
        watch: Told how many were read.
    """
    found: list[Recorded] = []
    troubles: list[str] = []
    for count, run in enumerate(runs, start=1):
        try:
            found.append(shelf.read(run))
        except RunError as error:
            troubles.append(f"Left out: {error}")
        watch(count)
    return found, troubles


def _summary(pam: Numbers) -> tuple[Any, ...]:
    """Of each episode what `SUMMARY` names."""
    return pam >= SAFE, pam >= ACCOMPLISHED, accomplished_comfort(pam), pam


def padded(configuration: Configuration, pam: Numbers, lengths: Numbers) -> Numbers:
    """Of each episode its share in the padded S+T+C.

    Args:
        configuration: Of the training; who knows no horizon pads up to the longest episode.
        pam: (n,) of the episodes.
        lengths: (n,) steps.
    """
    ours = benchmark_of(configuration.environment)
    horizon = configuration.horizon or (lengths.max() if ours is None else ours.horizon)
    return accomplished_comfort(pam) * np.minimum(lengths / horizon, 1.0)


def _stamp(folder: Path) -> list[int]:
    """What changes when anything is recorded."""
    stamp: list[int] = []
    for file in (folder / RUN_FILE, folder / EVALUATIONS_FILE, *sorted(folder.glob(PATTERN))):
        # One of them may be missing, which reading it says.
        if file.is_file():
            found = file.stat()
            stamp += [found.st_mtime_ns, found.st_size]
    return stamp
