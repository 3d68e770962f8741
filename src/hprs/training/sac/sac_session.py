"""What sessions of SAC share, wherever their environments are."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from hprs.deploy import BoxLayout, ObservationLayout
from hprs.training.actions import squashed_actions_of
from hprs.training.configuration import Configuration
from hprs.training.learner_session import CHECKS, LearnerSession, Policy, finite
from hprs.training.networks import Layer
from hprs.training.sac.learner import Member, Report, Shape
from hprs.training.sac.settings import Settings
from hprs.wrappers.single import TaskWrapper


class SacSession(LearnerSession):
    """The shape of what learns, and what becomes of it.

    Args:
        configuration: What to train.
        environment: The wrapped environment.
    """

    notice: str
    """What it needs of memory."""

    def __init__(self, configuration: Configuration, environment: TaskWrapper) -> None:
        super().__init__(configuration, environment)
        self.shape = Shape(
            settings=Settings.of(configuration.parameters),
            observation=int(np.prod(self._observations.shape)),
            actions=squashed_actions_of(environment.action_space),
        )

    @abstractmethod
    def learned(self, member: int) -> Member:
        """What a member has learned so far."""

    def policy(self, member: int) -> Policy:
        """A member's policy as it is now: the means, without the deviations."""
        learned, actions = jax.device_get(self.learned(member)), self.shape.actions
        *hidden, last = learned.parameters.policy
        mean = Layer(last.weights[:, : actions.outputs], last.bias[: actions.outputs])
        low, high = self._observations.low.ravel(), self._observations.high.ravel()
        drawn = np.random.default_rng(0).standard_normal((CHECKS, self.shape.observation))
        likely = np.clip(drawn, low, high).astype(np.float32)
        return Policy(
            network=[*hidden, mean],
            activation="relu",
            observation=ObservationLayout(self._observations.shape),
            action=BoxLayout(
                actions.shape,
                np.asarray(actions.low, np.float32),
                np.asarray(actions.high, np.float32),
                mapping="tanh",
            ),
            likely=likely,
            answers=np.asarray(self.shape.best(learned, jnp.asarray(likely))),
        )


def holds_numbers(learned: Member) -> Array:
    """Whether networks are finite, () bool, under `jit`."""
    return finite((learned.parameters, learned.targets))


def told(report: Report) -> Mapping[str, Any]:
    """What is told of an update, by the names of events."""
    return {f"train/{name}": float(value) for name, value in report._asdict().items()}
