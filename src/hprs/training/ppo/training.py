"""Trains a run with PPO, wherever its environment is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import is_dataclass, replace
from typing import TYPE_CHECKING, Any

import gymnasium as gym
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker, TimeLimit

from hprs.training.configuration import Configuration
from hprs.training.environment import make_configured, require
from hprs.training.listener import Listener
from hprs.training.run_directory import RunDirectory

if TYPE_CHECKING:
    from hprs.training.session import Session

_TRANSPARENT = (OrderEnforcing, PassiveEnvChecker, TimeLimit)
"""Wrappers that change nothing but the horizon."""


def train(run: RunDirectory, listener: Listener | None = None) -> bool:
    """Train to the end of the configuration, from the newest checkpoint if there is one.

    Returns:
        Whether the training is complete; false if it was interrupted.

    Raises:
        RunError: See `hprs.training.session.train`.
        MissingExtraError: JAX is not installed.
    """
    for package in ("jax", "optax", "tensorboard"):
        require(package, "jax")
    from hprs.training import session

    return session.train(run, listener, open_session)


def open_session(configuration: Configuration, notice: Callable[[str], None]) -> Session:
    """A training that has not learned anything yet."""
    from hprs.training.compilation import keep_compiled_programs
    from hprs.training.ppo.learner_session import horizon_of
    from hprs.training.ppo.on_device import DeviceSession
    from hprs.training.ppo.on_host import open_host

    keep_compiled_programs()
    environment = make_configured(configuration)
    simulation = simulation_of(environment.env, horizon_of(environment))
    if simulation is not None:
        return DeviceSession(configuration, environment, simulation)
    return open_host(configuration, environment)


def simulation_of(environment: gym.Env[Any, Any], horizon: int) -> Any:
    """The JAX functions behind an environment, with its horizon; None where there are none.

    Wrappers that change observations or actions hide them: what they do, the functions do not.
    """
    import jax.numpy as jnp

    from hprs.training.device import Simulation

    while isinstance(environment, gym.Wrapper):
        if not isinstance(environment, _TRANSPARENT):
            return None
        environment = environment.env
    found = getattr(environment, "simulation", None)
    if not isinstance(found, Simulation):
        return None
    if is_dataclass(found) and hasattr(found, "horizon"):
        return replace(found, horizon=jnp.asarray(horizon, jnp.int32))
    return found
