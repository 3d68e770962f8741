"""What a training must remember to go on, whatever the trainer, with checksums."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hprs.training import files
from hprs.training.evaluation import Episode
from hprs.training.replay import Segment

MANIFEST = "manifest.json"


@dataclass(frozen=True)
class Progress:
    """How far a training has got."""

    step: int = 0
    """Environment steps so far."""
    next_evaluation: int = 0
    """The step from which on the next evaluation is due."""
    evaluated: int = -1
    """The step of the newest evaluation."""
    evaluations: int = 0
    """How many evaluations were made."""
    best_pam: float = -1.0
    """Highest mean PAM of an evaluation so far."""
    best_step: int = -1
    """The step of that evaluation."""

    def after(
        self, step: int, episodes: Sequence[Episode], interval_after: Callable[[int], int]
    ) -> Progress:
        """The progress after an evaluation; of equally good policies the first stays the best.

        Args:
            step: The step at which the policy was evaluated.
            episodes: The evaluation's episodes.
            interval_after: Steps to the next evaluation, by the number of evaluations made:
                `Configuration.interval_after`.
        """
        interval = interval_after(self.evaluations + 1)
        pam = float(np.mean([episode.assessment.pam for episode in episodes]))
        better = pam > self.best_pam
        return Progress(
            step=step,
            next_evaluation=(step // interval + 1) * interval,
            evaluated=step,
            evaluations=self.evaluations + 1,
            best_pam=pam if better else self.best_pam,
            best_step=step if better else self.best_step,
        )


@dataclass(frozen=True)
class Checkpoint:
    """A training's whole state."""

    progress: Progress
    """How far it has got."""
    rows: str
    """The rows of its newest evaluation: a kill may come before they reach the table."""
    contents: Mapping[str, bytes] = field(repr=False)
    """The trainer's files by name."""
    segments: tuple[Segment, ...] = ()
    """The segments of its replay buffer, which lie elsewhere."""

    def save(self, folder: Path) -> None:
        """Write it into an empty folder, through to the disk."""
        manifest = {
            "progress": asdict(self.progress),
            "rows": self.rows,
            "files": {name: files.checksum(content) for name, content in self.contents.items()},
            "segments": [asdict(segment) for segment in self.segments],
        }
        for name, content in self.contents.items():
            files.write(folder / name, content)
        sealed = {"sha256": files.checksum(_canonical(manifest)), **manifest}
        files.write(folder / MANIFEST, (json.dumps(sealed, indent=2) + "\n").encode())

    @classmethod
    def load(cls, folder: Path) -> Checkpoint:
        """Read it from its folder.

        Raises:
            RunError: A file is missing, or is not what was written.
        """
        manifest = _load_manifest(folder / MANIFEST)
        return cls(
            progress=Progress(**manifest["progress"]),
            rows=manifest["rows"],
            contents={
                name: files.read_checked(folder / name, sha256)
                for name, sha256 in manifest["files"].items()
            },
            segments=tuple(Segment(**segment) for segment in manifest["segments"]),
        )


def _load_manifest(file: Path) -> dict[str, Any]:
    try:
        manifest = json.loads(files.read(file))
        seal = manifest.pop("sha256")
    except (ValueError, KeyError, AttributeError):
        raise files.damaged(file) from None
    if seal != files.checksum(_canonical(manifest)):
        raise files.damaged(file)
    return manifest


def _canonical(content: Mapping[str, Any]) -> bytes:
    return json.dumps(content, sort_keys=True).encode()
