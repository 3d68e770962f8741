"""What sessions of PPO share, wherever their environments are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax
import numpy as np
from gymnasium import spaces
from jax import Array

from hprs.deploy import Bundle
from hprs.errors import UsageError
from hprs.training.actions import actions_of
from hprs.training.configuration import Configuration
from hprs.training.ppo.learner import Member, Shape
from hprs.training.ppo.settings import Settings
from hprs.training.signal_scale import SignalScale
from hprs.wrappers.single import TaskWrapper

STATE = "state.npz"
CHECKS = 16
"""Observations that a bundle can check itself with."""


class LearnerSession:
    """A learner with its hyper-parameters and what is told of its updates.

    Args:
        configuration: What to train.
        environment: The wrapped environment.
        scale: Of the task's signals.
    """

    member: Member
    """What has been learned so far; a subclass says where it is."""

    def __init__(
        self, configuration: Configuration, environment: TaskWrapper, scale: SignalScale
    ) -> None:
        space = environment.observation_space
        if not isinstance(space, spaces.Box):
            raise UsageError(
                f"the JAX trainer cannot handle observations of a {type(space).__name__} space; "
                "use --trainer sb3."
            )
        settings = Settings.of(configuration.parameters)
        self.shape = Shape(
            settings=settings,
            observation=int(np.prod(space.shape)),
            signals=scale.size,
            actions=actions_of(environment.action_space),
        )
        self.weights = self.shape.weights(configuration.steps)
        self._configuration, self._spaces = configuration, (space, environment.action_space)
        self._scalars: dict[str, float] = {}

    @property
    def scalars(self) -> Mapping[str, float]:
        """What is told of the newest update."""
        return self._scalars

    def told(self, scalars: Mapping[str, Array]) -> None:
        """Keep what an update reports."""
        found = jax.device_get(dict(scalars))
        self._scalars = {f"train/{name}": float(value) for name, value in found.items()}

    def is_finite(self) -> bool:
        """Whether the networks hold numbers."""
        leaves = jax.tree.leaves(jax.device_get(self.member.parameters))
        return all(bool(np.isfinite(leaf).all()) for leaf in leaves)

    def bundle(self, provenance: Mapping[str, object]) -> Bundle:
        """The policy as it is now."""
        raise NotImplementedError

    def close(self) -> None:
        """Nothing to close."""


def horizon_of(environment: TaskWrapper) -> int:
    """Steps after which an environment's episodes are cut off."""
    spec: Any = environment.spec
    return int(spec.max_episode_steps)
