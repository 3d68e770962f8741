"""The trainers and the algorithms that each of them offers, as data."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from hprs.envs.registration import benchmark_of
from hprs.errors import UsageError, did_you_mean
from hprs.training.tuning import Tuning, parse_tuning


@dataclass(frozen=True)
class Algorithm:
    """An algorithm, as a trainer offers it."""

    name: str
    """Its name on the command line."""
    trainer: str
    """A key of `TRAINERS`."""
    spaces: tuple[str, ...]
    """The action spaces it can handle."""
    observations: tuple[str, ...] | None = None
    """The observation spaces it can handle; None: any."""
    class_name: str = ""
    """Its name in `stable_baselines3`, where that trains."""
    critic: str | None = None
    """What `net_arch` calls the networks beside the policy's, `pi`; None: they have no name."""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """Hyper-parameters that differ from the trainer's defaults."""

    @property
    def takes_noise(self) -> bool:
        """Whether noise can be added to its actions: where all of them are numbers."""
        return self.trainer == "sb3" and self.spaces == ("Box",)


def _sb3(
    name: str, spaces: tuple[str, ...], critic: str | None, parameters: Mapping[str, Any]
) -> Algorithm:
    return Algorithm(
        name, "sb3", spaces, class_name=name.upper(), critic=critic, parameters=parameters
    )


_ANY_ACTION = ("Box", "Discrete", "MultiDiscrete", "MultiBinary")

_ALGORITHMS = (
    Algorithm("ppo", "jax", ("Box", "Discrete"), ("Box",)),
    Algorithm("sac", "jax", ("Box",), ("Box",), critic="qf"),
    # Stable-Baselines3 would collect 2,048 steps of each of the 8 environments.
    _sb3("ppo", _ANY_ACTION, "vf", {"environments": 8, "n_steps": 256}),
    _sb3("a2c", _ANY_ACTION, "vf", {"environments": 8}),
    # A step of HPRS is worth 0.01 to 0.1. The customary initial entropy coefficient of 1
    # drowns it: a car then stands still for 30,000 steps, and laps after 5,000 with 0.02.
    _sb3("sac", ("Box",), "qf", {"ent_coef": "auto_0.02", "scale_reward": False}),
    _sb3("td3", ("Box",), "qf", {"action_noise": 0.1, "scale_reward": False}),
    _sb3("ddpg", ("Box",), "qf", {"action_noise": 0.1, "scale_reward": False}),
    _sb3("dqn", ("Discrete",), None, {"scale_reward": False}),
)

TRAINERS: Mapping[str, Mapping[str, Algorithm]] = MappingProxyType(
    {
        trainer: MappingProxyType({a.name: a for a in _ALGORITHMS if a.trainer == trainer})
        for trainer in ("jax", "sb3")
    }
)
"""Trainer to the algorithms that it offers, by name; an algorithm's default is the first trainer
that offers it."""

ALGORITHMS = tuple(dict.fromkeys(algorithm.name for algorithm in _ALGORITHMS))
"""The names of all algorithms."""

DEFAULT_ALGORITHM = "ppo"
"""The algorithm where none is named: by far the fastest where steps are cheap."""

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
"""Hyper-parameters that are not arguments of an algorithm of Stable-Baselines3: type, default,
meaning."""

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
    return parse_tuning(benchmark.hyperparameters_text, path=path, trainers=TRAINERS)


def default_steps(environment: str, algorithm: Algorithm) -> int:
    """Environment steps of a training, where the user does not say how many."""
    tuning = tuning_of(environment)
    return DEFAULT_STEPS if tuning is None else tuning.steps_of(algorithm.trainer, algorithm.name)


def find_algorithm(name: str | None = None, trainer: str | None = None) -> Algorithm:
    """An algorithm by name.

    Args:
        name: One of `ALGORITHMS`; None: the default.
        trainer: A key of `TRAINERS`; None: the first that offers the algorithm.

    Raises:
        UsageError: There is no such algorithm or trainer, or the trainer does not offer it.
    """
    chosen = (name or DEFAULT_ALGORITHM).lower()
    if chosen not in ALGORITHMS:
        raise UsageError(
            f"unknown algorithm '{name}'; choose one of {', '.join(ALGORITHMS)}."
            f"{did_you_mean(chosen, ALGORITHMS)}"
        )
    offering = [other for other, offered in TRAINERS.items() if chosen in offered]
    if trainer is None:
        return TRAINERS[offering[0]][chosen]
    if trainer not in TRAINERS:
        raise UsageError(
            f"unknown trainer '{trainer}'; choose one of {', '.join(TRAINERS)}."
            f"{did_you_mean(trainer, TRAINERS)}"
        )
    if trainer not in offering:
        raise UsageError(
            f"the trainer {trainer} has no {chosen}; it has {', '.join(TRAINERS[trainer])}. "
            f"For {chosen}: --trainer {' or '.join(offering)}."
        )
    return TRAINERS[trainer][chosen]


def check_spaces(algorithm: Algorithm, actions: str, observations: str = "Box") -> None:
    """See that an algorithm can handle an environment.

    Args:
        algorithm: The algorithm.
        actions: The class of the action space, as in "Box".
        observations: The class of the observation space.

    Raises:
        UsageError: It cannot; the message says what can.
    """
    if actions in algorithm.spaces and _observes(algorithm, observations):
        return
    able = [a for a in _ALGORITHMS if actions in a.spaces and _observes(a, observations)]
    kind, space = ("actions", actions)
    if actions in algorithm.spaces:
        kind, space = ("observations", observations)
    if any(other.name == algorithm.name for other in able):
        name = f"{algorithm.name} of the trainer {algorithm.trainer}"
        [other] = [a.trainer for a in able if a.name == algorithm.name]
        advice = f"that of {other} can: --trainer {other}."
    else:
        name, names = algorithm.name, dict.fromkeys(other.name for other in able)
        advice = f"choose one of {', '.join(names)}." if names else "no algorithm can."
    raise UsageError(f"{name} cannot handle {kind} of a {space} space; {advice}")


def _observes(algorithm: Algorithm, space: str) -> bool:
    return algorithm.observations is None or space in algorithm.observations


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
