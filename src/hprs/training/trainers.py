"""Finds what trains a run: the only place that knows where the trainers are."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Protocol

from hprs.errors import RunError
from hprs.training.configuration import Configuration
from hprs.training.interruption import Interruption
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


class TrainTogether(Protocol):
    """Trains runs that make one program."""

    def __call__(
        self,
        runs: Sequence[RunDirectory],
        listeners: Sequence[Listener],
        interruption: Interruption,
        /,
    ) -> list[bool | RunError]:
        """Of each run whether it is complete, or what is wrong with it."""
        ...


_MODULES: Mapping[tuple[str, str], str] = MappingProxyType(
    {("jax", "ppo"): "hprs.training.ppo", ("jax", "sac"): "hprs.training.sac"}
)
"""Trainer and algorithm to the module that has `train`; Stable-Baselines3's is one for all."""


def trainer_of(configuration: Configuration) -> Train:
    """What trains a configuration; nothing else is imported."""
    key = configuration.trainer, configuration.algorithm
    return importlib.import_module(_MODULES.get(key, "hprs.training.sb3")).train


def together_of(configuration: Configuration) -> tuple[str, TrainTogether] | None:
    """What program a configuration is trained in, and what trains all of its members at once.

    None for a trainer that trains one at a time, and where environments need a process each.
    """
    module = _MODULES.get((configuration.trainer, configuration.algorithm))
    if module is None:
        return None
    found = importlib.import_module(module)
    program = found.program_of(configuration)
    return None if program is None else (program, found.train_together)


def prefers_programs(configurations: Sequence[Configuration]) -> bool:
    """Whether members are trained fastest in one program: on a GPU, but not on a CPU."""
    if not any((c.trainer, c.algorithm) in _MODULES for c in configurations):
        return False
    if importlib.import_module("jax").default_backend() == "cpu":
        return False
    return all(together_of(configuration) is not None for configuration in configurations)
