"""What learns: networks, optimisers and entropy coefficient of one member, and one update of them.

Soft actor-critic (Haarnoja et al., 2018) with a learned entropy coefficient, twin critics and
Polyak targets, in the order of Stable-Baselines3's updates.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jax import Array

from hprs.training.actions import SquashedActions
from hprs.training.networks import Network, apply, make_uniform_network
from hprs.training.sac.settings import Settings
from hprs.training.schedules import start_of

OPTIMISER = optax.scale_by_adam()
"""Without a learning rate, in which members may differ."""


class Parameters(NamedTuple):
    """What the optimiser changes."""

    policy: Network
    """Means and logarithms of deviations, side by side."""
    critics: tuple[Network, Network]
    """Of observation and action."""
    log_entropy: Array
    """Logarithm of the entropy coefficient, ()."""


class Optimisers(NamedTuple):
    """The states of the optimisers of each of the parameters."""

    policy: Any
    critics: Any
    log_entropy: Any


class Member(NamedTuple):
    """One member of a population, between two updates."""

    parameters: Parameters
    targets: tuple[Network, Network]
    """The critics as the targets see them."""
    optimiser: Optimisers
    key: Array
    """Data of the JAX key for what is still to be drawn, (2,) uint32."""


class Weights(NamedTuple):
    """Hyper-parameters that members of a population need not share; scalars."""

    learning_rate: Array
    """At the start of the training."""
    decay: Array
    """Share of it that an environment step takes away: 0 for a constant."""
    gamma: Array
    tau: Array
    target_entropy: Array
    entropy_rate: Array
    """1 where the entropy coefficient is learned, else 0."""
    horizon_is_terminal: Array
    """Whether nothing is expected after the horizon: 1 or 0."""


class Batch(NamedTuple):
    """Transitions, (B, ...)."""

    observation: Array
    action: Array
    """In [-1, 1]."""
    reward: Array
    terminated: Array
    truncated: Array
    valid: Array
    """False where a step only reset an environment."""
    reached: Array
    """The observation that the action led to; where an episode ended, its final one."""


class Report(NamedTuple):
    """What is told of an update, scalars."""

    critic_loss: Array
    policy_loss: Array
    entropy_loss: Array
    ent_coef: Array
    entropy: Array


@dataclass(frozen=True, eq=False)
class Shape:
    """What compiled functions must know: everything that members share."""

    settings: Settings
    observation: int
    """Components of an observation."""
    actions: SquashedActions

    def make(self, seed: int, parameters: Mapping[str, Any]) -> Member:
        """A member that has learned nothing."""
        hidden, critic_hidden = self.settings.layers
        of_policy, *of_critics, of_key = np.random.SeedSequence(seed).spawn(4)
        outputs = self.actions.outputs
        policy = make_uniform_network(
            np.random.default_rng(of_policy), (self.observation, *hidden, 2 * outputs)
        )
        one, other = (
            make_uniform_network(
                np.random.default_rng(seeds), (self.observation + outputs, *critic_hidden, 1)
            )
            for seeds in of_critics
        )
        first = Settings.of(parameters).first_entropy
        log_entropy = jnp.asarray(math.log(max(first, 1e-38)), float)
        made = Parameters(policy, (one, other), log_entropy)
        return Member(
            parameters=made,
            # Of their own: what is updated in place must be there once.
            targets=jax.tree.map(jnp.copy, made.critics),
            optimiser=Optimisers(*map(OPTIMISER.init, made)),
            key=jnp.asarray(of_key.generate_state(2, np.uint32)),
        )

    def weights(self, parameters: Mapping[str, Any], steps: int) -> Weights:
        """The hyper-parameters that are not shapes, of one member.

        Args:
            parameters: All hyper-parameters.
            steps: Environment steps of the whole training, for schedules.
        """
        settings = Settings.of(parameters)
        rate = settings.learning_rate
        start = start_of(rate) if isinstance(rate, str) else None
        target = settings.target_entropy
        values = (
            rate if start is None else start,
            0.0 if start is None else 1 / steps,
            settings.gamma,
            settings.tau,
            -float(self.actions.outputs) if isinstance(target, str) else target,
            float(settings.learns_entropy),
            float(settings.horizon_is_terminal),
        )
        return Weights(*(jnp.asarray(value, float) for value in values))

    def act(self, member: Member, observation: Array, noise: Array) -> Array:
        """Actions in [-1, 1], drawn."""
        outputs = apply(member.parameters.policy, observation, jax.nn.relu)
        return self.actions.draw(outputs, noise)[0]

    def best(self, member: Member, observation: Array) -> Array:
        """The actions of no noise, as the environment takes them."""
        outputs = apply(member.parameters.policy, observation, jax.nn.relu)
        return self.actions.for_environment(self.actions.mode(outputs))

    def update(
        self, member: Member, batch: Batch, noise: Array, weights: Weights, made: Array
    ) -> tuple[Member, Report]:
        """The member after one update.

        Args:
            member: Before.
            batch: Drawn from what is remembered.
            noise: For the actions in the states left and in those reached, (2, B, outputs).
            weights: Hyper-parameters.
            made: Environment steps before the update, ().
        """
        parameters, optimiser = member.parameters, member.optimiser
        rate = weights.learning_rate * jnp.maximum(1 - weights.decay * made, 0)
        (action, log_prob), pull = jax.vjp(
            lambda policy: self._drawn(policy, batch.observation, noise[0]), parameters.policy
        )
        coefficient = jnp.exp(parameters.log_entropy)
        surplus = jax.lax.stop_gradient(log_prob) + weights.target_entropy
        entropy_gradient = -_mean(surplus, batch.valid)

        target = self.target(member, batch, noise[1], weights)
        critic_loss, critic_gradient = jax.value_and_grad(self.critic_loss)(
            parameters.critics, batch, target
        )
        critics, critic_state = _stepped(
            parameters.critics, critic_gradient, optimiser.critics, rate
        )

        policy_loss, cotangents = jax.value_and_grad(self.policy_loss, (0, 1))(
            action, log_prob, critics, batch, coefficient
        )
        [policy_gradient] = pull(cotangents)
        policy, policy_state = _stepped(parameters.policy, policy_gradient, optimiser.policy, rate)
        log_entropy, entropy_state = _stepped(
            parameters.log_entropy,
            entropy_gradient,
            optimiser.log_entropy,
            rate * weights.entropy_rate,
        )
        report = Report(
            critic_loss=critic_loss,
            policy_loss=policy_loss,
            entropy_loss=parameters.log_entropy * entropy_gradient,
            ent_coef=coefficient,
            entropy=-_mean(log_prob, batch.valid),
        )
        targets = jax.tree.map(
            lambda old, new: old + weights.tau * (new - old), member.targets, critics
        )
        member = member._replace(
            parameters=Parameters(policy, critics, log_entropy),
            targets=targets,
            optimiser=Optimisers(policy_state, critic_state, entropy_state),
        )
        return member, report

    def target(self, member: Member, batch: Batch, noise: Array, weights: Weights) -> Array:
        """What the critics should say, (B,).

        A terminated episode has no future; a truncated one has that of its own final state.
        """
        action, log_prob = self._drawn(member.parameters.policy, batch.reached, noise)
        values = jnp.minimum(*_values(member.targets, batch.reached, action))
        future = values - jnp.exp(member.parameters.log_entropy) * log_prob
        ended = batch.terminated | (batch.truncated & (weights.horizon_is_terminal > 0))
        return batch.reward + weights.gamma * jnp.where(ended, 0.0, future)

    def critic_loss(self, critics: tuple[Network, Network], batch: Batch, target: Array) -> Array:
        """Half of the squared errors of both critics."""
        one, other = (
            _mean((value - target) ** 2, batch.valid)
            for value in _values(critics, batch.observation, batch.action)
        )
        return 0.5 * (one + other)

    def policy_loss(
        self,
        action: Array,
        log_prob: Array,
        critics: tuple[Network, Network],
        batch: Batch,
        coefficient: Array,
    ) -> Array:
        """Weighted entropy less the lower of both critics' values."""
        values = jnp.minimum(*_values(critics, batch.observation, action))
        return _mean(coefficient * log_prob - values, batch.valid)

    def _drawn(self, policy: Network, observation: Array, noise: Array) -> tuple[Array, Array]:
        return self.actions.draw(apply(policy, observation, jax.nn.relu), noise)


def _values(
    critics: tuple[Network, Network], observation: Array, action: Array
) -> tuple[Array, Array]:
    inputs = jnp.concatenate([observation, action], -1)
    one, other = (apply(critic, inputs, jax.nn.relu)[..., 0] for critic in critics)
    return one, other


def _mean(values: Array, valid: Array) -> Array:
    number = jnp.maximum(jnp.sum(valid), 1)
    return jnp.sum(jnp.where(valid, values, 0.0)) / number


def _stepped(parameters: Any, gradient: Any, state: Any, rate: Array) -> tuple[Any, Any]:
    direction, state = OPTIMISER.update(gradient, state)
    return jax.tree.map(lambda p, d: p - rate * d, parameters, direction), state
