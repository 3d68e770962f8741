"""Finds the JAX functions behind an environment: what has some is trained on the device."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import is_dataclass, replace
from typing import Any

import gymnasium as gym
import jax
import jax.numpy as jnp
import numpy as np
from gymnasium import spaces
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker, TimeLimit

from hprs.envs.simulated import Simulation
from hprs.errors import UsageError
from hprs.rewards.base import Reward
from hprs.semantics.plan import plan_of
from hprs.spec.task import Task
from hprs.training.compilation import keep_compiled_programs
from hprs.training.configuration import Configuration
from hprs.training.device import DeviceEnvironment
from hprs.training.environment import make_configured
from hprs.training.session import Session
from hprs.training.signal_scale import signal_scale
from hprs.wrappers.signals import make_reader, zero_action
from hprs.wrappers.single import TaskWrapper

_TRANSPARENT = (OrderEnforcing, PassiveEnvChecker, TimeLimit)
"""Wrappers that change nothing but the horizon."""

_ON_DEVICE: dict[str, bool] = {}


def open_session(
    configurations: Sequence[Configuration],
    on_device: Callable[[Sequence[Configuration], TaskWrapper, Any], Session],
    on_host: Callable[[Configuration, TaskWrapper], Session],
) -> Session:
    """Trainings in one program, in which nothing is learned yet.

    Args:
        configurations: What to train.
        on_device: Makes the session of environments that are JAX functions, from a wrapped one and
            its simulation.
        on_host: Makes the session of one that Python steps. Both only look at the environment.

    Raises:
        UsageError: There are several, of environments that Python steps.
    """
    keep_compiled_programs()
    first = configurations[0]
    environment = make_configured(first)
    try:
        simulation = simulation_of(environment)
        if simulation is not None:
            return on_device(configurations, environment, simulation)
        if len(configurations) > 1:
            raise UsageError(
                f"{first.environment} is stepped by Python: its trainings need a process each."
            )
        return on_host(first, environment)
    finally:
        environment.close()


def is_on_device(configuration: Configuration) -> bool:
    """Whether an environment is trained as JAX functions; found out once for all members."""
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
        _ON_DEVICE[key] = simulation_of(environment) is not None
        environment.close()
    return _ON_DEVICE[key]


def device_environment(task: Task, reward: Reward, environment: TaskWrapper) -> DeviceEnvironment:
    """A task and a reward as JAX functions.

    Args:
        task: The task.
        reward: What is paid.
        environment: A wrapped environment, for its spaces and horizon.
    """
    seen, done = environment.observation_space, environment.action_space
    return DeviceEnvironment(
        task=task,
        reward=reward,
        reader=make_reader(task, seen, done),
        scale=signal_scale(task),
        zero_action=jnp.asarray(zero_action(done), None if _counts(done) else float),
        horizon=horizon_of(environment),
    )


def _counts(space: gym.Space[Any]) -> bool:
    return isinstance(space, spaces.Discrete)


def horizon_of(environment: TaskWrapper) -> int:
    """Steps after which an environment's episodes are cut off."""
    spec: Any = environment.spec
    return int(spec.max_episode_steps)


def simulation_of(environment: TaskWrapper) -> Any:
    """The JAX functions behind an environment, with its horizon; None where there are none.

    Wrappers that change observations or actions hide them: what they do, the functions do not.
    So does a task that reads more of `info` than its signals, and a space that is no flat row of
    floating numbers.
    """
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
        return replace(found, horizon=jnp.asarray(horizon_of(environment), jnp.int32))
    return found


def _suits_the_device(environment: TaskWrapper) -> bool:
    seen, done = environment.observation_space, environment.action_space
    flat = isinstance(seen, spaces.Box) and len(seen.shape) == 1
    real = isinstance(done, spaces.Discrete) or np.issubdtype(done.dtype, np.floating)
    used = plan_of(environment.task).signals
    sources = [one.source for one in environment.task.signals if one.name in used]
    return flat and real and all(source is None or source.root != "info" for source in sources)
