"""What sessions of the JAX trainer share, whatever they learn with, wherever environments are."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from gymnasium import spaces
from jax import Array

from hprs.deploy import Bundle, Layer, ObservationLayout
from hprs.deploy.layouts import ActionLayout
from hprs.envs.registration import benchmark_of
from hprs.errors import UsageError
from hprs.spec.json_format import task_to_json
from hprs.training.configuration import Configuration
from hprs.training.description import described, details_of
from hprs.training.networks import Network
from hprs.wrappers.single import TaskWrapper

STATE = "state.npz"
CHECKS = 16
"""Observations that a bundle can check itself with."""


class Policy(NamedTuple):
    """What a bundle holds of a learner's policy."""

    network: Network
    activation: str
    observation: ObservationLayout
    action: ActionLayout
    likely: np.ndarray
    """Observations like those of the training, (CHECKS, n) float32."""
    answers: np.ndarray
    """What the learner does there."""


class LearnerSession(ABC):
    """What is trained, and what becomes of it.

    Args:
        configuration: What to train.
        environment: The wrapped environment.
    """

    def __init__(self, configuration: Configuration, environment: TaskWrapper) -> None:
        space = environment.observation_space
        if not isinstance(space, spaces.Box):
            raise UsageError(
                f"the JAX trainer cannot handle observations of a {type(space).__name__} space; "
                "use --trainer sb3."
            )
        self._configuration, self._observations = configuration, space
        self._details = details_of(environment, configuration.task)
        # Of other environments the rate of pictures need not be that of decisions.
        ours = benchmark_of(configuration.environment) is not None
        self._rate: float | None = environment.metadata.get("render_fps") if ours else None

    @abstractmethod
    def policy(self, member: int) -> Policy:
        """A member's policy as it is now."""

    def bundle(self, member: int, provenance: Mapping[str, object]) -> Bundle:
        """A member's policy as it is now, with checks that its network has answered."""
        policy = self.policy(member)
        plain = Bundle(
            layers=tuple(Layer(*map(np.asarray, one)) for one in policy.network),
            observation=policy.observation,
            action=policy.action,
            activation=policy.activation,
            task=task_to_json(self._configuration.task),
            rate=self._rate,
            provenance={**self._configuration.home, **provenance},
            check_observations=policy.likely,
            check_actions=policy.answers,
        )
        return described(plain, self._details)


def finite(tree: Any) -> Array:
    """Whether all numbers of a tree are, () bool, under `jit`."""
    return jnp.stack([jnp.isfinite(leaf).all() for leaf in jax.tree.leaves(tree)]).all()


def told(scalars: Mapping[str, Array]) -> dict[str, float]:
    """What an update reports, by the names of events."""
    found = jax.device_get(dict(scalars))
    return {f"train/{name}": float(value) for name, value in found.items()}
