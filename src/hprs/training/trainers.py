"""Finds what trains a run: the only place that knows where the trainers are."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Protocol

from hprs.training.configuration import Configuration
from hprs.training.listener import Listener
from hprs.training.run_directory import RunDirectory


class Train(Protocol):
    """Trains a run to its end, from wherever it was left."""

    def __call__(self, run: RunDirectory, listener: Listener | None = None, /) -> bool:
        """Whether the training is complete; false if it was interrupted.

        Raises:
            RunError: The run cannot be read, written or gone on with, another process trains it, or
                the training diverged.
        """
        ...


_MODULES: Mapping[tuple[str, str], str] = MappingProxyType({("jax", "ppo"): "hprs.training.ppo"})
"""Trainer and algorithm to the module that has `train`; Stable-Baselines3's is one for all."""


def trainer_of(configuration: Configuration) -> Train:
    """What trains a configuration; nothing else is imported."""
    key = configuration.trainer, configuration.algorithm
    return importlib.import_module(_MODULES.get(key, "hprs.training.sb3")).train
