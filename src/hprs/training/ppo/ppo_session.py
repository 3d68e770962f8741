"""What sessions of PPO share, wherever their environments are."""

from __future__ import annotations

from abc import abstractmethod

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from hprs.deploy import BoxLayout, ChoiceLayout, ObservationLayout
from hprs.training.actions import BoxActions, DiscreteActions, actions_of
from hprs.training.configuration import Configuration
from hprs.training.learner_session import CHECKS, LearnerSession, Policy, finite
from hprs.training.ppo.learner import Member, Shape
from hprs.training.ppo.settings import Settings
from hprs.training.signal_scale import SignalScale
from hprs.training.statistics import LARGEST, Statistics
from hprs.wrappers.single import TaskWrapper


class PpoSession(LearnerSession):
    """The shape of what learns, and what becomes of it.

    Args:
        configuration: What to train.
        environment: The wrapped environment.
        scale: Of the task's signals.
    """

    notice = ""

    def __init__(
        self, configuration: Configuration, environment: TaskWrapper, scale: SignalScale
    ) -> None:
        super().__init__(configuration, environment)
        self.shape = Shape(
            settings=Settings.of(configuration.parameters),
            observation=int(np.prod(self._observations.shape)),
            signals=scale.size,
            actions=actions_of(environment.action_space),
        )

    @abstractmethod
    def learned(self, member: int) -> Member:
        """What a member has learned so far."""

    def policy(self, member: int) -> Policy:
        """A member's policy as it is now."""
        learned = jax.device_get(self.learned(member))
        normalised, seen = self.shape.settings.normalize_observations, learned.observations
        likely = _likely(seen, np.random.default_rng(0))
        return Policy(
            network=learned.parameters.policy,
            activation="tanh",
            observation=ObservationLayout(
                shape=self._observations.shape,
                mean=np.asarray(seen.mean) if normalised else None,
                deviation=np.asarray(seen.deviation) if normalised else None,
                clip=LARGEST,
            ),
            action=_layout(self.shape.actions),
            likely=likely,
            answers=np.asarray(self.shape.best(learned, jnp.asarray(likely))),
        )

    def ring(self, member: int) -> None:
        """Nothing is remembered."""


def holds_numbers(learned: Member) -> Array:
    """Whether networks and statistics are finite, () bool, under `jit`."""
    return finite((learned.parameters, learned.observations, learned.returns))


def _likely(seen: Statistics, generator: np.random.Generator) -> np.ndarray:
    """Observations like those of the training, (CHECKS, n) float32."""
    spread = generator.standard_normal((CHECKS, len(seen.mean)))
    return np.asarray(seen.mean + spread * np.asarray(seen.deviation), np.float32)


def _layout(actions: BoxActions | DiscreteActions) -> BoxLayout | ChoiceLayout:
    if isinstance(actions, DiscreteActions):
        return ChoiceLayout(actions.outputs, actions.start)
    low, high = np.asarray(actions.low, np.float32), np.asarray(actions.high, np.float32)
    return BoxLayout(actions.shape, low, high)
