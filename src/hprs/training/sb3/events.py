"""Lets Stable-Baselines3 write TensorBoard's files as the other trainers do."""

from __future__ import annotations

from typing import Any

import numpy as np

from hprs.training.events import EventWriter
from hprs.training.run_directory import RunDirectory


def make_logger(run: RunDirectory, step: int) -> Any:
    """A logger of Stable-Baselines3 that writes numbers for TensorBoard.

    Args:
        run: Where the file is made.
        step: The step that the training goes on from: what was written of later ones is void.
    """
    from stable_baselines3.common.logger import KVWriter, Logger

    writer = EventWriter(run, step)

    class Events(KVWriter):
        """Passes on what is meant for TensorBoard."""

        def write(
            self,
            key_values: dict[str, Any],
            key_excluded: dict[str, tuple[str, ...]],
            step: int = 0,
        ) -> None:
            numbers = {
                key: float(value)
                for key, value in key_values.items()
                if isinstance(value, int | float | np.number)
                and "tensorboard" not in (key_excluded.get(key) or ())
            }
            writer.write(numbers, step)

        def close(self) -> None:
            writer.close()

    return Logger(folder=str(run.path), output_formats=[Events()])
