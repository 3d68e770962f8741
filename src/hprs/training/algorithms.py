"""The learning algorithms and their hyper-parameters, as data.

A value is looked up in this order: `--set` on the command line, what the reward asks for, the file
of the benchmark, the table of the algorithm, the default of Stable-Baselines3.
"""

from __future__ import annotations

import difflib
import json
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from hprs.envs.registration import benchmark_of
from hprs.errors import UsageError, did_you_mean
from hprs.rewards.base import NO_DEMANDS, Demands
from hprs.training.ranges import check_range, check_together, shown
from hprs.training.schedules import start_of
from hprs.training.tuning import Tuning, parse_tuning


@dataclass(frozen=True)
class Algorithm:
    """An algorithm of Stable-Baselines3."""

    name: str
    """Its name on the command line."""
    class_name: str
    """Its name in `stable_baselines3`."""
    spaces: tuple[str, ...]
    """The action spaces it can handle."""
    critic: str | None
    """What Stable-Baselines3 calls the networks beside the policy's, `pi`; None: there are none."""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """Hyper-parameters that differ from Stable-Baselines3's defaults."""

    @property
    def takes_noise(self) -> bool:
        """Whether noise can be added to its actions: where all of them are numbers."""
        return self.spaces == ("Box",)


_ANY_ACTION = ("Box", "Discrete", "MultiDiscrete", "MultiBinary")

ALGORITHMS: Mapping[str, Algorithm] = MappingProxyType(
    {
        algorithm.name: algorithm
        for algorithm in (
            # Stable-Baselines3 would collect 2,048 steps of each of the 8 environments.
            Algorithm("ppo", "PPO", _ANY_ACTION, "vf", {"environments": 8, "n_steps": 256}),
            Algorithm("a2c", "A2C", _ANY_ACTION, "vf", {"environments": 8}),
            # A step of HPRS is worth 0.01 to 0.1. The customary initial entropy coefficient of 1
            # drowns it: a car then stands still for 30,000 steps, and laps after 5,000 with 0.02.
            Algorithm(
                "sac", "SAC", ("Box",), "qf", {"ent_coef": "auto_0.02", "scale_reward": False}
            ),
            Algorithm("td3", "TD3", ("Box",), "qf", {"action_noise": 0.1, "scale_reward": False}),
            Algorithm("ddpg", "DDPG", ("Box",), "qf", {"action_noise": 0.1, "scale_reward": False}),
            Algorithm("dqn", "DQN", ("Discrete",), None, {"scale_reward": False}),
        )
    }
)
"""Name to algorithm; the only place that lists them."""

DEFAULT_ALGORITHMS: Mapping[str, str] = MappingProxyType({"Box": "sac"})
"""Kind of action space to the algorithm taken there; PPO for all others."""

OURS: Mapping[str, tuple[Any, Any, str]] = MappingProxyType(
    {
        "environments": (int, 1, "environments that are stepped side by side"),
        # Where policy and critics differ, it is an object: {"pi": [64, 64], "qf": [256, 256]}.
        "net_arch": (list[int], (64, 64), "hidden layers of the networks"),
        "scale_reward": (bool, True, "divide rewards by the running deviation of the return"),
        "horizon_is_terminal": (bool, False, "expect nothing after the horizon: no bootstrapping"),
        "action_noise": (float, 0.0, "deviation of the noise added to actions, in their unit"),
        "threads": (int, 1, "threads of PyTorch; more than one slows small networks down"),
    }
)
"""Hyper-parameters that are not arguments of the algorithm: type, default, meaning."""

DEFAULT_STEPS = 1_000_000
"""Environment steps of a training where no file says how many suffice."""


def tuning_of(environment: str) -> Tuning | None:
    """What a benchmark is trained with; None for an environment that is not ours.

    Raises:
        UsageError: The benchmark's file is wrong.
    """
    benchmark = benchmark_of(environment)
    if benchmark is None:
        return None
    path = f"{benchmark.id}/{benchmark.hyperparameters}"
    return parse_tuning(benchmark.hyperparameters_text, path=path, algorithms=ALGORITHMS)


def default_steps(environment: str) -> int:
    """Environment steps of a training, where the user does not say how many."""
    tuning = tuning_of(environment)
    return DEFAULT_STEPS if tuning is None else tuning.steps


def find_algorithm(name: str | None, action_space: str, environment: str = "") -> Algorithm:
    """An algorithm by name, or the default of a benchmark or of an action space.

    Args:
        name: A key of `ALGORITHMS`, or None.
        action_space: The class of the action space, as in "Box".
        environment: The environment's id.

    Raises:
        UsageError: There is no such algorithm, or it cannot handle the action space.
    """
    if name is None:
        tuning = tuning_of(environment)
        default = DEFAULT_ALGORITHMS.get(action_space, "ppo")
        name = default if tuning is None else tuning.algorithm
    algorithm = ALGORITHMS.get(name.lower())
    if algorithm is None:
        raise UsageError(
            f"unknown algorithm '{name}'; choose one of {', '.join(ALGORITHMS)}."
            f"{did_you_mean(name.lower(), ALGORITHMS)}"
        )
    if action_space not in algorithm.spaces:
        able = [other.name for other in ALGORITHMS.values() if action_space in other.spaces]
        raise UsageError(
            f"{algorithm.name} cannot handle actions of a {action_space} space; "
            + (f"choose one of {', '.join(able)}." if able else "no algorithm can.")
        )
    return algorithm


def parse_settings(settings: Sequence[str], option: str = "--set") -> dict[str, Any]:
    """The pairs of `--set KEY=VALUE`; a value is a JSON value, anything else is text.

    Args:
        settings: The pairs.
        option: The name of the option, for the messages.

    Raises:
        UsageError: One is not a pair, or a key is given twice.
    """
    found: dict[str, Any] = {}
    for setting in settings:
        key, equals, text = (part.strip() for part in setting.partition("="))
        if not equals or not key:
            raise UsageError(f"{option} takes KEY=VALUE, got '{setting}'.")
        if key in found:
            raise UsageError(f"{option} {key} is given twice.")
        try:
            found[key] = json.loads(text)
        # Beside what is no JSON: numbers of thousands of digits, lists nested as deep.
        except (ValueError, RecursionError):
            found[key] = {"True": True, "False": False, "None": None}.get(text, text)
    return found


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
        own: The algorithm's own arguments: name to type and default.
        action_space: The class of the action space.
        demands: What the reward asks of the learner.

    Raises:
        UsageError: A name is unknown, a value has the wrong type or is out of range, or two values
            exclude one another.
    """
    known = {**own, **{name: (kind, value) for name, (kind, value, _) in OURS.items()}}
    tuning = tuning_of(environment)
    tuned = {} if tuning is None else tuning.tables.get(algorithm.name, {})
    try:
        _check_all(algorithm, tuned, known)
    except UsageError as error:
        raise UsageError(f"{tuning.path if tuning else environment}: {error}") from None
    _check_all(algorithm, overrides, known)
    chosen = {name: default for name, (_, default) in known.items()}
    chosen |= {**algorithm.parameters, **tuned, **demanded_parameters(demands), **overrides}
    _check_together(algorithm, chosen, action_space)
    return {name: list(v) if isinstance(v, tuple) else v for name, v in sorted(chosen.items())}


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


def _check_together(algorithm: Algorithm, parameters: Mapping[str, Any], action_space: str) -> None:
    check_together(algorithm.name, parameters)
    if parameters["action_noise"] > 0.0 and not algorithm.takes_noise:
        able = ", ".join(other.name for other in ALGORITHMS.values() if other.takes_noise)
        raise UsageError(f"{algorithm.name} takes no action_noise; {able} do.")
    if parameters.get("use_sde") and action_space != "Box":
        raise UsageError(
            f"{algorithm.name}'s use_sde needs actions of a Box space, not of a "
            f"{action_space} space."
        )


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
