"""The hyper-parameters of a training: where each value comes from, and whether it can be meant.

A value is looked up in this order: `--set` on the command line, what the reward asks for, the file
of the benchmark, what this project sets for the algorithm, the default of the trainer.
"""

from __future__ import annotations

import difflib
import importlib
import types
import typing
from collections.abc import Callable, Mapping
from copy import deepcopy
from types import MappingProxyType
from typing import Any

from hprs.errors import UsageError, did_you_mean
from hprs.rewards.base import NO_DEMANDS, Demands
from hprs.training import algorithms
from hprs.training.algorithms import OURS, TRAINERS, Algorithm
from hprs.training.environment import require
from hprs.training.ranges import check_minibatches, check_range, check_together, shown
from hprs.training.schedules import start_of


def resolve_parameters(
    algorithm: Algorithm,
    environment: str,
    overrides: Mapping[str, Any],
    own: Mapping[str, tuple[Any, Any]],
    *,
    action_space: str = "Box",
    demands: Demands = NO_DEMANDS,
) -> dict[str, Any]:
    """All hyper-parameters of a training, checked.

    Args:
        algorithm: The algorithm.
        environment: The environment's id.
        overrides: What the user sets.
        own: What the algorithm can be told, see `known_parameters`.
        action_space: The class of the action space.
        demands: What the reward asks of the learner.

    Raises:
        UsageError: A name is unknown, a value has the wrong type or is out of range, or two values
            exclude one another.
    """
    tuning = algorithms.tuning_of(environment)
    tuned = {} if tuning is None else tuning.table(algorithm.trainer, algorithm.name)
    try:
        _check_all(algorithm, tuned, own)
    except UsageError as error:
        raise UsageError(f"{tuning.path if tuning else environment}: {error}") from None
    _check_all(algorithm, overrides, own)
    chosen = {name: deepcopy(default) for name, (_, default) in own.items()}
    chosen |= {**algorithm.parameters, **tuned, **demanded_parameters(demands), **overrides}
    _CHECKS[algorithm.trainer](algorithm, chosen, action_space)
    return {name: list(v) if isinstance(v, tuple) else v for name, v in sorted(chosen.items())}


def known_parameters(algorithm: Algorithm) -> dict[str, tuple[Any, Any]]:
    """What an algorithm can be told: name to annotation and default.

    Raises:
        MissingExtraError: Its trainer is not installed.
    """
    if algorithm.trainer == "jax":
        require("jax", "jax")
        require("optax", "jax")
        module = importlib.import_module(f"hprs.training.{algorithm.name}.settings")
        return dict(module.HYPERPARAMETERS)
    from hprs.training.sb3.settings import hyperparameters

    kind = getattr(require("stable_baselines3", "sb3"), algorithm.class_name)
    ours = {name: (annotation, value) for name, (annotation, value, _) in OURS.items()}
    return {**hyperparameters(kind), **ours}


def demanded_parameters(demands: Demands) -> dict[str, Any]:
    """What a reward asks of the learner, as hyper-parameters."""
    found: dict[str, Any] = {} if demands.discount is None else {"gamma": demands.discount}
    return found | ({"horizon_is_terminal": True} if demands.horizon_is_terminal else {})


def _similar(name: str, known: Mapping[str, Any]) -> str:
    close = difflib.get_close_matches(name, known, n=3, cutoff=0.3)
    return (
        f" It has {', '.join(sorted(known))}." if not close else f" Close are {', '.join(close)}."
    )


def _check_all(
    algorithm: Algorithm, values: Mapping[str, Any], known: Mapping[str, tuple[Any, Any]]
) -> None:
    for name, value in values.items():
        if name not in known:
            raise UsageError(
                f"{algorithm.name} has no hyper-parameter '{name}'."
                f"{did_you_mean(name, known) or _similar(name, known)}"
            )
        kind = known[name][0]
        for part in _networks(algorithm, value) if name == "net_arch" else [value]:
            _check(algorithm.name, name, part, kind)


def _networks(algorithm: Algorithm, value: Any) -> list[Any]:
    """The hidden layers of each kind of network; what is no object stands for all of them."""
    if not isinstance(value, dict) or algorithm.critic is None:
        return [value]
    if value.keys() != {"pi", algorithm.critic}:
        raise UsageError(
            f"{algorithm.name}'s net_arch must be a list like [64, 64], or an object like "
            f'{{"pi": [64, 64], "{algorithm.critic}": [256, 256]}}, got {shown(value)}.'
        )
    return list(value.values())


def _check_jax(algorithm: Algorithm, parameters: Mapping[str, Any], action_space: str) -> None:
    del action_space
    check_together(algorithm.name, parameters)
    if "n_steps" in parameters:
        check_minibatches(algorithm.name, parameters)
    if parameters.get("gradient_steps", 1) < 1:
        # Stable-Baselines3 takes -1 for as many as there were steps.
        raise UsageError(
            f"{algorithm.name} of the trainer jax takes a gradient_steps from 1 on, got "
            f"{parameters['gradient_steps']}: name the number, or use --trainer sb3."
        )


def _check_sb3(algorithm: Algorithm, parameters: Mapping[str, Any], action_space: str) -> None:
    check_together(algorithm.name, parameters)
    if parameters["action_noise"] > 0.0 and not algorithm.takes_noise:
        able = ", ".join(other.name for other in TRAINERS["sb3"].values() if other.takes_noise)
        raise UsageError(f"{algorithm.name} takes no action_noise; {able} do.")
    if parameters.get("use_sde") and action_space != "Box":
        raise UsageError(
            f"{algorithm.name}'s use_sde needs actions of a Box space, not of a "
            f"{action_space} space."
        )


_CHECKS: Mapping[str, Callable[[Algorithm, Mapping[str, Any], str], None]] = MappingProxyType(
    {"jax": _check_jax, "sb3": _check_sb3}
)
"""Trainer to what must hold between its hyper-parameters."""


def _check(algorithm: str, name: str, value: Any, kind: Any) -> None:
    if not _accepts(value, kind):
        raise UsageError(f"{algorithm}'s {name} must be {_describe(kind)}, got {shown(value)}.")
    check_range(algorithm, name, value)


def _accepts(value: Any, kind: Any) -> bool:
    """Whether a JSON value can stand where an annotation is written."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        return any(_accepts(value, option) for option in arguments)
    if origin is Callable:
        return isinstance(value, str) and start_of(value) is not None
    if origin in (list, tuple):
        return isinstance(value, list) and (
            origin is tuple or all(_accepts(item, arguments[0]) for item in value)
        )
    if origin is dict:
        return isinstance(value, dict)
    if kind is float:
        return isinstance(value, int | float) and not isinstance(value, bool)
    if kind is int:
        return isinstance(value, int) and not isinstance(value, bool)
    return kind in (bool, str, type(None)) and isinstance(value, kind)


_WORDS: Mapping[Any, str] = {
    int: "a whole number",
    float: "a number",
    bool: "true or false",
    str: "text",
    type(None): "null",
}


def _describe(kind: Any) -> str:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(dict.fromkeys(_describe(option) for option in arguments))
    if origin is Callable:
        return "a schedule like linear_0.001"
    if origin in (list, tuple):
        return "a list like [64, 64]" if origin is list else 'a list like [1, "episode"]'
    if origin is dict:
        return "a JSON object"
    return _WORDS.get(kind, str(kind))
