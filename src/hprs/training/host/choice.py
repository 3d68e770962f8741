"""Chooses how a training's environments are stepped."""

from __future__ import annotations

import inspect
from typing import Any

import gymnasium as gym
from gymnasium.envs.registration import EnvSpec, load_env_creator

from hprs.training.configuration import Configuration
from hprs.training.environment import make_configured
from hprs.training.host.interface import HostEnvironments
from hprs.training.host.single import SingleEnvironments
from hprs.training.host.vector import VectorEnvironments
from hprs.wrappers.single import TaskWrapper
from hprs.wrappers.vector import wrap_vector


def make_host(
    configuration: Configuration, number: int, *, vectorized: bool = True
) -> HostEnvironments:
    """A training's environments.

    Args:
        configuration: The training.
        number: How many environments.
        vectorized: Whether to take a native vector environment where there is one.

    Raises:
        UsageError: The environment or the reward is unknown, or episodes have no horizon.
        SignalError: The environment lacks a signal of the task.
    """
    first = make_configured(configuration)
    spec = gym.spec(configuration.environment.rpartition(":")[2])
    options = {**configuration.environment_options, "max_episode_steps": _horizon(first)}
    if not (vectorized and _vectorised(spec, options)):
        others = [make_configured(configuration) for _ in range(number - 1)]
        return SingleEnvironments([first, *others])
    first.close()
    bare = gym.make_vec(spec.id, number, vectorization_mode="vector_entry_point", **options)
    # The reward is not made anew: of a vector environment only the registered horizon is known.
    return VectorEnvironments(wrap_vector(bare, configuration.task, first.reward))


def _horizon(environment: TaskWrapper) -> int | None:
    spec = environment.spec
    return None if spec is None else spec.max_episode_steps


def _vectorised(spec: EnvSpec, options: dict[str, Any]) -> bool:
    """Whether there is a native vector environment that takes the same options."""
    creator = spec.vector_entry_point
    if creator is None or spec.additional_wrappers:
        return False
    make = load_env_creator(creator) if isinstance(creator, str) else creator
    parameters = inspect.signature(make).parameters
    anything = any(each.kind is each.VAR_KEYWORD for each in parameters.values())
    return anything or all(name in parameters for name in [*spec.kwargs, *options])
