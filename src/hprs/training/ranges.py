"""The range of every hyper-parameter that is a number, and what must hold between several.

Stable-Baselines3 checks few of its arguments: most nonsense either trains nothing, silently, or
fails in the middle of a training. The trainers of our own check none: what reaches them is right.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from hprs.errors import UsageError
from hprs.training.schedules import number_after, start_of


@dataclass(frozen=True)
class Range:
    """An interval of numbers; NaN and infinity lie in none."""

    low: float
    """Its lower end."""
    high: float = sys.float_info.max
    """Its upper end."""
    above: bool = False
    """Whether the lower end itself is excluded."""
    special: int | None = None
    """One value outside that has a meaning of its own."""

    def __contains__(self, value: float) -> bool:
        """Whether a number is allowed."""
        if value == self.special:
            return True
        return (self.low < value if self.above else self.low <= value) and value <= self.high

    def __str__(self) -> str:
        """What a number must do to lie in it."""
        if self.high < sys.float_info.max:
            text = f"lie in {'(' if self.above else '['}{self.low:g}, {_plain(self.high)}]"
        elif self.low == -self.high:
            text = "be finite"
        elif self.low == 0.0:
            text = "be positive and finite" if self.above else "not be negative, and be finite"
        else:
            text = f"be at least {self.low:g}"
        return text if self.special is None else f"be {self.special}, or {text}"


_FINITE = Range(-sys.float_info.max)
_POSITIVE = Range(0.0, above=True)
_NOT_NEGATIVE = Range(0.0)
_FRACTION = Range(0.0, 1.0)
_POSITIVE_FRACTION = Range(0.0, 1.0, above=True)
# Whole numbers beyond this no training reaches, and some do not fit into the types behind.
_COUNT = Range(1, 10**9)

RANGES: Mapping[str, Range] = MappingProxyType(
    {
        "action_noise": _NOT_NEGATIVE,
        "batch_size": Range(1, 10**6),
        "buffer_size": _COUNT,
        "clip_range": _POSITIVE,
        "clip_range_vf": _POSITIVE,
        "ent_coef": _NOT_NEGATIVE,
        "environments": Range(1, 4096),
        "exploration_final_eps": _FRACTION,
        # Stable-Baselines3 divides by it.
        "exploration_fraction": _POSITIVE_FRACTION,
        "exploration_initial_eps": _FRACTION,
        "gae_lambda": _FRACTION,
        "gamma": _POSITIVE_FRACTION,
        # -1: as many as environment steps were made since the last ones.
        "gradient_steps": Range(1, 10**6, special=-1),
        "learning_rate": _POSITIVE_FRACTION,
        "learning_starts": Range(0, 10**9),
        # A deviation of more than e^2 times half the range of actions is none; e^-20 is 0.
        "log_std_init": Range(-20.0, 2.0),
        "max_grad_norm": _POSITIVE,
        "n_epochs": Range(1, 10**6),
        "n_steps": Range(1, 10**6),
        "net_arch": Range(1, 10**4),
        "policy_delay": _COUNT,
        "rms_prop_eps": _POSITIVE,
        # -1: a new exploration matrix at the start of a rollout only.
        "sde_sample_freq": Range(1, 10**9, special=-1),
        "stats_window_size": Range(1, 10**6),
        "target_entropy": _FINITE,
        "target_kl": _POSITIVE,
        "target_noise_clip": _NOT_NEGATIVE,
        "target_policy_noise": _NOT_NEGATIVE,
        "target_update_interval": _COUNT,
        "tau": _POSITIVE_FRACTION,
        "threads": Range(1, 256),
        "train_freq": Range(1, 10**6),
        "vf_coef": _NOT_NEGATIVE,
    }
)
"""Hyper-parameter to its range, in every algorithm that has it; of a list, each item's."""

_SCHEDULED = ("learning_rate",)
"""Hyper-parameters whose only texts are schedules."""

_UNITS = ("step", "episode")
"""What `train_freq` may be counted in."""


def check_range(algorithm: str, name: str, value: Any) -> None:
    """Check a value that has the right type already.

    Args:
        algorithm: Name of the algorithm, for the message.
        name: Name of the hyper-parameter.
        value: Its value, as JSON gives it.

    Raises:
        UsageError: It is out of range.
    """
    if isinstance(value, str):
        _check_text(algorithm, name, value)
    for number in _numbers(value):
        if number not in RANGES[name]:
            raise UsageError(f"{algorithm}'s {name} must {RANGES[name]}, got {shown(value)}.")
    if name == "train_freq" and isinstance(value, list) and not _is_frequency(value):
        raise UsageError(
            f"{algorithm}'s train_freq must be a whole number, or a list like "
            f'[1, "episode"], got {shown(value)}.'
        )


def check_together(algorithm: str, parameters: Mapping[str, Any]) -> None:
    """Check what must hold between the hyper-parameters of a training.

    Raises:
        UsageError: Two of them exclude one another.
    """
    environments, batch = parameters["environments"], parameters.get("batch_size", 1)
    buffer, frequency = parameters.get("buffer_size"), parameters.get("train_freq")
    if buffer is not None and buffer < batch:
        raise UsageError(
            f"{algorithm}'s buffer_size must be at least its batch_size, got {buffer} and {batch}."
        )
    length = parameters.get("n_steps", 1)
    if buffer is not None and buffer < length * environments:
        raise UsageError(
            f"{algorithm}'s buffer_size must be at least its n_steps times its environments, "
            f"got {buffer}, {length} and {environments}."
        )
    if isinstance(frequency, list) and frequency[1] == "episode" and environments > 1:
        raise UsageError(
            f"{algorithm} can count train_freq in episodes only with environments=1, "
            f"got {environments}."
        )
    if parameters.get("normalize_advantage"):
        rollout = length * environments
        if rollout < 2 or parameters.get("batch_size", rollout) < 2:
            raise UsageError(
                f"{algorithm} cannot normalise the advantage of one step: raise batch_size, "
                "n_steps or environments, or set normalize_advantage=false."
            )


def check_minibatches(algorithm: str, parameters: Mapping[str, Any]) -> None:
    """Check that the transitions of a rollout can be divided into equal minibatches.

    Raises:
        UsageError: They cannot.
    """
    length, environments = parameters["n_steps"], parameters["environments"]
    batch = parameters["batch_size"]
    if length * environments % batch:
        raise UsageError(
            f"{algorithm}'s batch_size must divide its environments times its n_steps, "
            f"got {batch}, {environments} and {length}."
        )


def shown(value: Any) -> str:
    """A value for a message: JSON, cut where it is long."""
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _check_text(algorithm: str, name: str, value: str) -> None:
    start = start_of(value)
    if name == "ent_coef" and value != "auto":
        start = number_after("auto_", value)
        if start is None or start <= 0.0:
            raise UsageError(
                f"{algorithm}'s ent_coef must be a number, auto, or its first value like "
                f"auto_0.1, got {shown(value)}."
            )
    elif name == "target_entropy" and value != "auto":
        raise UsageError(f"{algorithm}'s target_entropy must be a number or auto, got {value!r}.")
    elif name in _SCHEDULED and start is None:
        raise UsageError(
            f"{algorithm}'s {name} must be a number or a schedule like linear_0.001, "
            f"got {shown(value)}."
        )
    elif start is not None and start not in RANGES[name]:
        raise UsageError(f"{algorithm}'s {name} must {RANGES[name]}, got {shown(value)}.")


def _numbers(value: Any) -> Sequence[float]:
    if isinstance(value, bool):
        return ()
    if isinstance(value, int | float):
        return (value,)
    if isinstance(value, list):
        return [number for item in value for number in _numbers(item)]
    return ()


def _is_frequency(value: list[Any]) -> bool:
    return len(value) == 2 and type(value[0]) is int and value[1] in _UNITS


def _plain(number: float) -> str:
    return str(int(number)) if number == int(number) else f"{number:g}"
