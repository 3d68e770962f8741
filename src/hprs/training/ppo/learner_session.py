"""What sessions of PPO share, wherever their environments are."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from gymnasium import spaces
from jax import Array

from hprs.deploy import BoxLayout, Bundle, ChoiceLayout, Layer, ObservationLayout
from hprs.envs.registration import benchmark_of
from hprs.errors import UsageError
from hprs.spec.json_format import task_to_json
from hprs.training.actions import BoxActions, DiscreteActions, actions_of
from hprs.training.configuration import Configuration
from hprs.training.ppo.learner import Member, Shape
from hprs.training.ppo.settings import Settings
from hprs.training.signal_scale import SignalScale
from hprs.training.statistics import LARGEST, Statistics
from hprs.wrappers.single import TaskWrapper

STATE = "state.npz"
CHECKS = 16
"""Observations that a bundle can check itself with."""


class LearnerSession(ABC):
    """The shape of what learns, and what becomes of it.

    Args:
        configuration: What to train.
        environment: The wrapped environment.
        scale: Of the task's signals.
    """

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
        self._configuration, self._spaces = configuration, (space, environment.action_space)
        # Of other environments the rate of pictures need not be that of decisions.
        ours = benchmark_of(configuration.environment) is not None
        self._rate: float | None = environment.metadata.get("render_fps") if ours else None

    @abstractmethod
    def learned(self, member: int) -> Member:
        """What a member has learned so far."""

    def bundle(self, member: int, provenance: Mapping[str, object]) -> Bundle:
        """A member's policy as it is now, with checks that its network has answered."""
        learned, (observations, _) = jax.device_get(self.learned(member)), self._spaces
        normalised, seen = self.shape.settings.normalize_observations, learned.observations
        rows = _likely(seen, np.random.default_rng(0))
        given = self.shape.best(learned, jnp.asarray(rows))
        return Bundle(
            layers=tuple(Layer(*map(np.asarray, one)) for one in learned.parameters.policy),
            observation=ObservationLayout(
                shape=observations.shape,
                mean=np.asarray(seen.mean) if normalised else None,
                deviation=np.asarray(seen.deviation) if normalised else None,
                clip=LARGEST,
            ),
            action=_layout(self.shape.actions),
            task=task_to_json(self._configuration.task),
            rate=self._rate,
            provenance=dict(provenance),
            check_observations=rows,
            check_actions=np.asarray(given),
        )


def holds_numbers(learned: Member) -> Array:
    """Whether networks and statistics are finite, () bool, under `jit`."""
    watched = (learned.parameters, learned.observations, learned.returns)
    return jnp.stack([jnp.isfinite(leaf).all() for leaf in jax.tree.leaves(watched)]).all()


def told(scalars: Mapping[str, Array]) -> dict[str, float]:
    """What an update reports, by the names of events."""
    found = jax.device_get(dict(scalars))
    return {f"train/{name}": float(value) for name, value in found.items()}


def horizon_of(environment: TaskWrapper) -> int:
    """Steps after which an environment's episodes are cut off."""
    spec: Any = environment.spec
    return int(spec.max_episode_steps)


def _likely(seen: Statistics, generator: np.random.Generator) -> np.ndarray:
    """Observations like those of the training, (CHECKS, n) float32."""
    spread = generator.standard_normal((CHECKS, len(seen.mean)))
    return np.asarray(seen.mean + spread * np.asarray(seen.deviation), np.float32)


def _layout(actions: BoxActions | DiscreteActions) -> BoxLayout | ChoiceLayout:
    if isinstance(actions, DiscreteActions):
        return ChoiceLayout(actions.outputs, actions.start)
    low, high = np.asarray(actions.low, np.float32), np.asarray(actions.high, np.float32)
    return BoxLayout(actions.shape, low, high)
