"""Reads a task's signals out of what an environment returns.

The same readers serve one environment and a batch: indices and slices act on the last axis.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from hprs.errors import SignalError, UsageError, did_you_mean
from hprs.semantics.plan import plan_of
from hprs.spec.inference import evaluate_constant
from hprs.spec.misuse import shown
from hprs.spec.task import Signal, Source, Task

SignalFunction = Callable[[Any, Any, Any, Mapping[str, Any]], Mapping[str, Any]]
"""A user's function `(observation, action, last_action, info) -> {signal: value}`."""

Read = Callable[[Any, Any, Any, Mapping[str, Any]], Any]
"""Reads one signal from observation, action, last action and info; KeyError where it is missing."""

UNSUPPLIED = "neither the function given as `signals` nor info['signals'] supplies it."
"""Why a signal without a source is missing, where there is a function."""


@dataclass(frozen=True)
class Reader:
    """Reads every signal that a task uses.

    Args:
        reads: Signal name to its reader.
        initially: Signal name to its value where the source is missing at reset.
        vectors: Names of the signals that have components.
        declared: Names of all signals of the task, those that nothing uses included.
        function: The user's function, if there is one; its signals come first.
    """

    reads: Mapping[str, Read]
    initially: Mapping[str, Any]
    vectors: frozenset[str]
    declared: tuple[str, ...]
    function: SignalFunction | None = None

    last_action: bool = False
    """Whether a source is the last action."""
    quick: Callable[[list[float]], tuple[float, ...]] | None = None
    """Where all signals are components of one flat observation: picks them out of its list."""

    def __call__(
        self, observation: Any, action: Any, last_action: Any, info: Mapping[str, Any]
    ) -> dict[str, Any]:
        """The signals of a state reached by a step.

        Raises:
            SignalError: One is missing or unreadable.
        """
        values: dict[str, Any] = {}
        if self.function is not None:
            given = self.given(observation, action, last_action, info)
            values = {name: given[name] for name in self.reads if name in given}
        for name, read in self.reads.items():
            if name not in values:
                try:
                    values[name] = read(observation, action, last_action, info)
                except KeyError as error:
                    raise self._missing(name, info) from error
        return values

    def at_reset(self, observation: Any, action: Any, info: Mapping[str, Any]) -> dict[str, Any]:
        """The signals of s_0; `initially` stands in for what is missing."""
        values: dict[str, Any] = {}
        given = self.given(observation, action, action, info)
        unknown = [str(name) for name in given if name not in self.declared]
        if unknown:
            raise SignalError(
                f"the function given as `signals` returns '{unknown[0]}', which is no signal of "
                f"the task.{did_you_mean(unknown[0], self.declared)}"
            )
        for name, read in self.reads.items():
            try:
                values[name] = (
                    given[name] if name in given else read(observation, action, action, info)
                )
            except KeyError as error:
                if name not in self.initially:
                    raise self._missing(name, info, at_reset=True) from error
                values[name] = self.initially[name]
        return values

    def given(
        self, observation: Any, action: Any, last_action: Any, info: Mapping[str, Any]
    ) -> Mapping[str, Any]:
        """What the user's function supplies; nothing where there is none.

        Raises:
            SignalError: It returns no dictionary.
        """
        if self.function is None:
            return {}
        given: Any = self.function(observation, action, last_action, info)
        if not isinstance(given, Mapping):
            raise SignalError(
                "the function given as `signals` must return a dictionary from signal to value, "
                f"got {shown(given)}."
            )
        return cast("Mapping[str, Any]", given)

    def only_by_function(self, name: str) -> bool:
        """Whether a signal has no source, so that a user's function is asked for it."""
        return self.function is not None and getattr(self.reads[name], "unsourced", False)

    def _missing(
        self, name: str, info: Mapping[str, Any], *, at_reset: bool = False
    ) -> SignalError:
        advice = " Supply it, or give it a value with `initially`." if at_reset else ""
        return SignalError(
            f"signal '{name}' is missing{' at reset' if at_reset else ''}: "
            f"{self._reason(name, info)}{advice}"
        )

    def _reason(self, name: str, info: Mapping[str, Any]) -> str:
        if self.only_by_function(name):
            return UNSUPPLIED
        keys: Sequence[str] = getattr(self.reads[name], "keys", ())
        path, offered = "info", info
        for key in keys:
            if not (isinstance(offered, Mapping) and key in offered):
                known = [str(k) for k in offered] if isinstance(offered, Mapping) else []
                return f"{path} has no '{key}'.{did_you_mean(key, known)}"
            path, offered = f"{path}.{key}", offered[key]
        return f"{path} has no '{name}'."

    @property
    def reads_last_action(self) -> bool:
        """Whether the action before the last one must be remembered."""
        return self.function is not None or self.last_action

    @property
    def needs_probe(self) -> bool:
        """Whether only a reset can tell that every signal exists."""
        return self.function is not None or any(
            getattr(read, "from_info", False) for read in self.reads.values()
        )


def make_reader(
    task: Task,
    observation_space: gym.Space[Any],
    action_space: gym.Space[Any],
    function: SignalFunction | None = None,
) -> Reader:
    """A reader for a task over an environment's (single) spaces.

    Raises:
        SignalError: A source does not exist in the spaces, or has another shape than its signal.
        UsageError: What is given as the function is none.
    """
    if not (function is None or callable(function)):
        raise UsageError(
            "`signals` must be a function (observation, action, last_action, info) -> "
            f"{{signal: value}}, got {shown(function)}."
        )
    used = plan_of(task).signals
    signals = [signal for signal in task.signals if signal.name in used]
    known = task.analysis.known
    return Reader(
        reads={signal.name: _reader(signal, observation_space, action_space) for signal in signals},
        initially={
            signal.name: _filled(signal, evaluate_constant(signal.initially, known, signal.name))
            for signal in signals
            if signal.initially is not None
        },
        vectors=frozenset(signal.name for signal in signals if signal.length is not None),
        declared=tuple(signal.name for signal in task.signals),
        function=function,
        last_action=any(s.source is not None and s.source.root == "last_action" for s in signals),
        quick=_quick(signals, observation_space) if function is None else None,
    )


def _quick(
    signals: Sequence[Signal], space: gym.Space[Any]
) -> Callable[[list[float]], tuple[float, ...]] | None:
    """One C call that picks all signals out of a flat observation's list, if they all lie there.

    Indexing an array once a signal costs five times as much as one `tolist` and this.
    """
    indices = [
        signal.source.index
        for signal in signals
        if signal.source is not None and signal.source.root == "obs" and not signal.source.keys
    ]
    flat = isinstance(space, spaces.Box) and len(space.shape) == 1
    if not flat or len(indices) < max(2, len(signals)):
        return None
    if not all(isinstance(index, int) for index in indices):
        return None
    return operator.itemgetter(*indices)


def _filled(signal: Signal, value: float) -> Any:
    """The value, in every component of a vector."""
    return value if signal.length is None else np.full(signal.length, value)


def zero_action(space: gym.Space[Any]) -> Any:
    """Zero clipped to an action space: the action before the first one."""
    if isinstance(space, spaces.Box):
        return np.clip(np.zeros(space.shape, space.dtype), space.low, space.high)
    if isinstance(space, spaces.Discrete):
        return np.clip(0, space.start, space.start + space.n - 1)
    if isinstance(space, spaces.MultiDiscrete):
        return np.clip(
            np.zeros(space.shape, space.dtype), space.start, space.start + space.nvec - 1
        )
    if isinstance(space, spaces.MultiBinary):
        return np.zeros(space.shape, space.dtype)
    return None


class _InfoRead:
    """Reads a path of keys in `info`; it alone needs a reset to be checked."""

    from_info = True

    def __init__(self, name: str, source: Source | None, index: Any) -> None:
        self.unsourced = source is None
        self.keys = ("signals", name) if source is None else source.keys
        self._index = index
        self._reads = f"signal '{name}' reads {source or '.'.join(('info', *self.keys))}"

    def __call__(self, observation: Any, action: Any, last: Any, info: Mapping[str, Any]) -> Any:
        value: Any = info
        for key in self.keys:
            try:
                value = value[key]
            except (TypeError, IndexError):
                raise self._no_entries(key, value) from None
        if self._index is None:
            return value
        try:
            return np.asarray(value)[self._index]
        except (IndexError, TypeError, ValueError):
            path = ".".join(("info", *self.keys))
            raise SignalError(f"{self._reads}, but {path} is {_found(value)}.") from None

    def present(self, infos: Mapping[str, Any], count: int) -> Any:
        """In which of `count` sub-environments the path exists, by Gymnasium's masks `_key`."""
        present = np.ones(count, bool)
        value: Any = infos
        for key in self.keys:
            if not isinstance(value, Mapping):
                raise self._no_entries(key, value)
            if key not in value:
                return np.zeros(count, bool)
            present = present & value.get(f"_{key}", True)
            value = value[key]
        return present

    def _no_entries(self, key: str, value: Any) -> SignalError:
        path = ".".join(("info", *self.keys[: self.keys.index(key)]))
        return SignalError(f"{self._reads}, but {path} is {_found(value)}, which has no entries.")


def _found(value: Any) -> str:
    """A value in one line."""
    return " ".join(shown(value).split())


def _reader(
    signal: Signal, observation_space: gym.Space[Any], action_space: gym.Space[Any]
) -> Read:
    source = signal.source
    if source is None:
        return _InfoRead(signal.name, None, None)
    index: Any = None
    if source.index is not None:
        last = slice(*source.index) if isinstance(source.index, tuple) else source.index
        index = (..., last)
    if source.root == "info":
        return _InfoRead(signal.name, source, index)
    space = observation_space if source.root == "obs" else action_space
    _check_shape(signal, source, _subspace(signal, source, space))
    position = {"obs": 0, "action": 1, "last_action": 2}[source.root]
    keys = source.keys

    def read(*transition: Any) -> Any:
        value = transition[position]
        for key in keys:
            value = value[key]
        return value if index is None else value[index]

    return read


def _subspace(signal: Signal, source: Source, space: gym.Space[Any]) -> gym.Space[Any]:
    for key in source.keys:
        if not isinstance(space, spaces.Dict):
            raise SignalError(
                f"signal '{signal.name}' reads {source}, but {source.root} is {_kind(space)}, "
                "which has no entries."
            )
        if key not in space.spaces:
            raise SignalError(
                f"signal '{signal.name}' reads {source}, but the observation has no '{key}'."
                f"{did_you_mean(key, space.spaces)}"
            )
        space = space.spaces[key]
    return space


def _check_shape(signal: Signal, source: Source, space: gym.Space[Any]) -> None:
    if space.shape is None:
        raise SignalError(
            f"signal '{signal.name}' reads {source}, which is {_kind(space)}; "
            "name one of its entries."
        )
    shape = space.shape
    if source.index is not None and shape:
        try:
            last = slice(*source.index) if isinstance(source.index, tuple) else source.index
            shape = np.broadcast_to(np.empty(()), shape)[..., last].shape
        except IndexError:
            raise SignalError(
                f"signal '{signal.name}' reads {source}, but {source.root} has shape {space.shape}."
            ) from None
    elif source.index is not None:
        raise SignalError(
            f"signal '{signal.name}' reads {source}, but {source.root} is one number."
        )
    wanted = () if signal.length is None else (signal.length,)
    if shape != wanted:
        raise SignalError(
            f"signal '{signal.name}' {_length(wanted)}, but {source} {_length(shape)}."
        )


def _length(shape: tuple[int, ...]) -> str:
    if not shape:
        return "is one number"
    return f"has {shape[0]} components" if len(shape) == 1 else f"has shape {shape}"


def _kind(space: gym.Space[Any]) -> str:
    return f"a {type(space).__name__}"
