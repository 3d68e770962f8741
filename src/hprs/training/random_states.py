"""Seeds, and the states of random generators as JSON values: nothing of them is ever executed."""

from __future__ import annotations

import random
from collections.abc import Mapping
from typing import Any

import numpy as np


def derive_seed(seed: int, step: int, index: int = 0) -> int:
    """A seed that neighbouring seeds, later steps and other environments do not share."""
    entropy = [seed, step, index] if index else [seed, step]
    return int(np.random.SeedSequence(entropy).generate_state(1)[0] >> 2)


def training_seed(seed: int, step: int, index: int = 0) -> int:
    """Such a seed for an episode that is learned from: no evaluation has one so large."""
    return 2**30 + derive_seed(seed, step, index)


def generator_state(generator: np.random.Generator) -> dict[str, Any]:
    """The state of one of NumPy's generators."""
    return _to_json(generator.bit_generator.state)


def set_generator_state(generator: np.random.Generator, state: Mapping[str, Any]) -> None:
    """Bring a generator into a state.

    Raises:
        ValueError: The state is one of another kind of generator.
    """
    generator.bit_generator.state = _from_json(state)


def global_states() -> dict[str, Any]:
    """The states of Python's, NumPy's and PyTorch's global generators."""
    import torch

    version, numbers, normal = random.getstate()
    return {
        "python": [version, list(numbers), normal],
        "numpy": _to_json(np.random.get_state(legacy=False)),  # noqa: NPY002
        "torch": torch.get_rng_state().tolist(),
    }


def set_global_states(states: Mapping[str, Any]) -> None:
    """Bring the global generators into states."""
    import torch

    version, numbers, normal = states["python"]
    random.setstate((version, tuple(numbers), normal))
    np.random.set_state(_from_json(states["numpy"]))  # noqa: NPY002
    torch.set_rng_state(torch.tensor(states["torch"], dtype=torch.uint8))


def _to_json(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _to_json(inner) for key, inner in value.items()}
    if isinstance(value, np.ndarray):
        return {"dtype": value.dtype.str, "values": value.tolist()}
    return value.item() if isinstance(value, np.generic) else value


def _from_json(value: Any) -> Any:
    if not isinstance(value, Mapping):
        return value
    if set(value) == {"dtype", "values"}:
        return np.array(value["values"], dtype=value["dtype"])
    return {key: _from_json(inner) for key, inner in value.items()}
