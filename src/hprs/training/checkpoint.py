"""What a training must remember besides its networks, whatever the trainer."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from hprs.errors import RunError
from hprs.training.evaluation import Episode

FILE = "progress.json"


@dataclass(frozen=True)
class Progress:
    """How far a training has got."""

    step: int = 0
    """Environment steps so far."""
    next_evaluation: int = 0
    """The step from which on the next evaluation is due."""
    best_pam: float = -1.0
    """Highest mean PAM of an evaluation so far."""
    best_step: int = -1
    """The step of that evaluation."""

    def save(self, folder: Path) -> None:
        """Write it into a checkpoint."""
        (folder / FILE).write_text(json.dumps(asdict(self)) + "\n", encoding="utf-8")

    @classmethod
    def load(cls, folder: Path) -> Progress:
        """Read it from a checkpoint.

        Raises:
            RunError: It cannot be read.
        """
        try:
            return cls(**json.loads((folder / FILE).read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError) as error:
            raise RunError(f"{folder / FILE} cannot be read: {error}") from None

    def evaluated(self, step: int, episodes: Sequence[Episode], interval: int) -> Progress:
        """The progress after an evaluation; of equally good policies the first stays the best."""
        pam = float(np.mean([episode.assessment.pam for episode in episodes]))
        better = pam > self.best_pam
        return Progress(
            step=step,
            next_evaluation=(step // interval + 1) * interval,
            best_pam=pam if better else self.best_pam,
            best_step=step if better else self.best_step,
        )
