"""What the algorithms of Stable-Baselines3 can be told."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm

_NOT_HYPERPARAMETERS = frozenset(
    {
        "self",
        "policy",
        "env",
        "action_noise",
        "replay_buffer_class",
        "rollout_buffer_class",
        # It would also need `handle_timeout_termination` off, which bootstraps at no horizon.
        "optimize_memory_usage",
        "tensorboard_log",
        "verbose",
        "seed",
        "device",
        "_init_setup_model",
    }
)


def hyperparameters(kind: type[BaseAlgorithm]) -> dict[str, tuple[Any, Any]]:
    """An algorithm's own arguments that a user may set: name to annotation and default."""
    return {
        name: (parameter.annotation, parameter.default)
        for name, parameter in inspect.signature(kind.__init__).parameters.items()
        if name not in _NOT_HYPERPARAMETERS
    }
