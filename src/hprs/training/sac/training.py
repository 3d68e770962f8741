"""Trains a run with SAC, wherever its environment is."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING

from hprs.errors import RunError
from hprs.training.configuration import Configuration
from hprs.training.environment import require
from hprs.training.interruption import Interruption
from hprs.training.listener import Listener
from hprs.training.run_directory import RunDirectory

if TYPE_CHECKING:
    from hprs.training.session import Session

_FREE = ("learning_rate", "gamma", "tau", "target_entropy", "ent_coef", "horizon_is_terminal")
"""Hyper-parameters that are no shapes, nor counts of steps that members make together."""
_REWARD = ("reward", "end", "reward_options")


def train(run: RunDirectory, listener: Listener | None = None) -> bool:
    """Train to the end of the configuration, from the newest checkpoint if there is one.

    Returns:
        Whether the training is complete; false if it was interrupted.

    Raises:
        RunError: See `hprs.training.session.train`.
        MissingExtraError: JAX is not installed.
    """
    _require()
    from hprs.training import session

    return session.train(run, listener, open_session)


def train_together(
    runs: Sequence[RunDirectory], listeners: Sequence[Listener], interruption: Interruption
) -> list[bool | RunError]:
    """Train runs whose configurations make one program; see `session.train_together`."""
    _require()
    from hprs.training import session

    return session.train_together(runs, listeners, open_session, interruption)


def program_of(configuration: Configuration) -> str | None:
    """What a program is compiled for, as text: members may differ in the rest.

    That is the seed, the reward, and hyper-parameters that are not shapes. None where Python steps
    the environment.
    """
    from hprs.training.simulations import is_on_device

    if not is_on_device(configuration):
        return None
    content = {k: v for k, v in configuration.to_json().items() if k not in ("seed", *_REWARD)}
    parameters = {k: v for k, v in content["parameters"].items() if k not in _FREE}
    return json.dumps({**content, "parameters": parameters}, sort_keys=True)


def open_session(configurations: Sequence[Configuration]) -> Session:
    """Trainings in one program, in which nothing is learned yet.

    Raises:
        UsageError: There are several, of environments that Python steps.
    """
    from hprs.training import simulations
    from hprs.training.sac.on_device import DeviceSession
    from hprs.training.sac.on_host import open_host

    return simulations.open_session(configurations, DeviceSession, open_host)


def _require() -> None:
    for package in ("jax", "optax", "tensorboard"):
        require(package, "jax")
