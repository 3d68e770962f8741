"""An ONNX file as a policy, whoever wrote it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from hprs.errors import MissingExtraError, PolicyError

ONNX_SUFFIX = ".onnx"
"""How the name of an ONNX file ends."""


class OnnxPolicy:
    """A graph of one input, observations, and whose first output is actions.

    Both have the batch on their first axis. Where an environment asks for a choice, the output is
    the choice itself as an integer, or one number a choice, of which the largest is taken.

    Args:
        name: The file.
        environment: Where it shall act.

    Raises:
        PolicyError: The file is no ONNX model, or does not fit the environment.
        MissingExtraError: onnxruntime is not installed.
    """

    def __init__(self, name: str, environment: gym.Env[Any, Any]) -> None:
        self._session, failures = _opened(name)
        self._name, self._failures = name, failures
        self._space = environment.action_space
        inputs, output = self._session.get_inputs(), self._session.get_outputs()[0]
        if len(inputs) != 1:
            raise PolicyError(
                f"policy '{name}' has {len(inputs)} inputs, and one of observations is needed."
            )
        self._input, self._output = inputs[0], output
        self._is_single = isinstance(inputs[0].shape[0], int) and inputs[0].shape[0] == 1
        here = environment.observation_space
        if not _fits(inputs[0].shape[1:], here.shape):
            raise PolicyError(
                f"policy '{name}' sees observations of shape {_shown(inputs[0].shape[1:])}; this "
                f"environment has {_described(here)}."
            )
        if not self._acts():
            raise PolicyError(
                f"policy '{name}' gives {output.type} of shape {_shown(output.shape[1:])}; this "
                f"environment takes {_described(self._space)}."
            )

    def __call__(self, observation: Any, /) -> Any:
        """The action to take."""
        return self.batch([observation])[0]

    def batch(self, observations: Sequence[Any]) -> Any:
        """One action for each observation.

        Raises:
            PolicyError: The graph fails, or its action is NaN.
        """
        kind = np.float64 if self._input.type == "tensor(double)" else np.float32
        rows = np.stack([np.asarray(one, kind) for one in observations])
        pieces = np.split(rows, len(rows)) if self._is_single else [rows]
        try:
            found = [self._session.run(None, {self._input.name: one})[0] for one in pieces]
        except self._failures as error:
            raise PolicyError(f"policy '{self._name}' fails: {error}") from None
        outputs = np.concatenate(found)
        if isinstance(self._space, spaces.Discrete):
            if outputs.dtype.kind == "f":
                return int(self._space.start) + np.argmax(outputs, axis=-1)
            return outputs.reshape(len(rows))
        if np.isnan(outputs).any():
            raise PolicyError(f"policy '{self._name}' answered NaN.")
        low, high = self._space.low, self._space.high  # type: ignore[attr-defined]
        return np.clip(outputs, low, high).astype(self._space.dtype)

    def _acts(self) -> bool:
        """Whether the output is an action of the space."""
        shape, space = self._output.shape[1:], self._space
        whole = "int" in self._output.type
        if isinstance(space, spaces.Discrete):
            return shape in ([], [1]) if whole else _fits(shape, (int(space.n),))
        return isinstance(space, spaces.Box) and not whole and _fits(shape, space.shape)


def _opened(name: str) -> tuple[Any, tuple[type[Exception], ...]]:
    """A session, and the errors that it knows."""
    try:
        import onnxruntime
        from onnxruntime.capi import onnxruntime_pybind11_state as state
    except ModuleNotFoundError as error:
        if error.name != "onnxruntime":
            raise
        raise MissingExtraError("onnxruntime", "onnx") from None
    failures = tuple(
        found
        for found in vars(state).values()
        if isinstance(found, type) and issubclass(found, Exception)
    )
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 4
    # Networks of this size gain nothing from threads.
    options.intra_op_num_threads = 1
    try:
        session = onnxruntime.InferenceSession(name, options, providers=["CPUExecutionProvider"])
    except failures as error:
        reason = " ".join(str(error).split())
        raise PolicyError(f"policy '{name}' cannot be read as an ONNX model: {reason}") from None
    return session, failures


def _fits(found: Sequence[Any], wanted: tuple[int, ...] | None) -> bool:
    """Whether lengths agree; a text stands for any length."""
    return (
        wanted is not None
        and len(found) == len(wanted)
        and all(
            not isinstance(one, int) or one == other
            for one, other in zip(found, wanted, strict=True)
        )
    )


def _shown(shape: Sequence[Any]) -> str:
    return str(tuple(shape))


def _described(space: gym.Space[Any]) -> str:
    return f"shape {space.shape}" if isinstance(space, spaces.Box) else str(space)
