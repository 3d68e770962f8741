"""Trains a run with PPO, wherever its environment is."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import is_dataclass, replace
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker, TimeLimit

from hprs.errors import RunError, UsageError
from hprs.semantics.plan import plan_of
from hprs.training.configuration import Configuration
from hprs.training.environment import make_configured, require
from hprs.training.interruption import Interruption
from hprs.training.listener import Listener
from hprs.training.run_directory import RunDirectory
from hprs.wrappers.single import TaskWrapper

if TYPE_CHECKING:
    from hprs.training.session import Session

_ON_DEVICE: dict[str, bool] = {}

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

    That is the seed, and hyper-parameters that are not shapes. The reward knows the discount.
    None where Python steps the environment.
    """
    from hprs.training.ppo.losses import Weights

    if not _is_on_device(configuration):
        return None

    content = configuration.to_json()
    del content["seed"]
    free = set(Weights._fields) - {"gamma"}
    parameters = {k: v for k, v in content["parameters"].items() if k not in free}
    return json.dumps({**content, "parameters": parameters}, sort_keys=True)


def open_session(configurations: Sequence[Configuration]) -> Session:
    """Trainings in one program, in which nothing is learned yet.

    Raises:
        UsageError: There are several, of environments that Python steps.
    """
    from hprs.training.compilation import keep_compiled_programs
    from hprs.training.ppo.learner_session import horizon_of
    from hprs.training.ppo.on_device import DeviceSession
    from hprs.training.ppo.on_host import open_host

    keep_compiled_programs()
    first = configurations[0]
    # Only looked at: what is stepped is made by the sessions.
    environment = make_configured(first)
    try:
        simulation = simulation_of(environment, horizon_of(environment))
        if simulation is not None:
            return DeviceSession(configurations, environment, simulation)
        if len(configurations) > 1:
            raise UsageError(
                f"{first.environment} is stepped by Python: its trainings need a process each."
            )
        return open_host(first, environment)
    finally:
        environment.close()


def _is_on_device(configuration: Configuration) -> bool:
    """Whether an environment is trained as JAX functions; found out once for all members."""
    from hprs.training.ppo.learner_session import horizon_of

    key = json.dumps(
        [
            configuration.environment,
            configuration.task_text,
            configuration.horizon,
            dict(configuration.environment_options),
        ]
    )
    if key not in _ON_DEVICE:
        environment = make_configured(configuration)
        _ON_DEVICE[key] = simulation_of(environment, horizon_of(environment)) is not None
        environment.close()
    return _ON_DEVICE[key]


def _require() -> None:
    for package in ("jax", "optax", "tensorboard"):
        require(package, "jax")


def simulation_of(environment: TaskWrapper, horizon: int) -> Any:
    """The JAX functions behind an environment, with its horizon; None where there are none.

    Wrappers that change observations or actions hide them: what they do, the functions do not.
    So does a task that reads more of `info` than its signals, and a space that is no flat row of
    floating numbers.
    """
    import jax
    import jax.numpy as jnp

    from hprs.envs.simulated import Simulation

    bare: gym.Env[Any, Any] = environment.env
    while isinstance(bare, gym.Wrapper):
        if not isinstance(bare, _TRANSPARENT):
            return None
        bare = bare.env
    found = getattr(bare, "simulation", None)
    # Any object may have such functions; what JAX does not know as a tree is none of its own.
    if not isinstance(found, Simulation) or jax.tree_util.all_leaves([found]):
        return None
    if not _suits_the_device(environment):
        return None
    if is_dataclass(found) and hasattr(found, "horizon"):
        return replace(found, horizon=jnp.asarray(horizon, jnp.int32))
    return found


def _suits_the_device(environment: TaskWrapper) -> bool:
    seen, done = environment.observation_space, environment.action_space
    flat = isinstance(seen, spaces.Box) and len(seen.shape) == 1
    real = isinstance(done, spaces.Discrete) or np.issubdtype(done.dtype, np.floating)
    used = plan_of(environment.task).signals
    sources = [one.source for one in environment.task.signals if one.name in used]
    return flat and real and all(source is None or source.root != "info" for source in sources)
