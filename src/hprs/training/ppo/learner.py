"""What learns: networks, optimiser and statistics of one member, and one update of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jax import Array

from hprs.training.actions import BoxActions, DiscreteActions
from hprs.training.networks import Network, apply, make_network
from hprs.training.ppo.losses import Batch, Report, Weights, advantages, loss, normalised
from hprs.training.ppo.settings import Settings
from hprs.training.schedules import start_of
from hprs.training.statistics import LARGEST, Statistics, unseen

OPTIMISER = optax.scale_by_adam(eps=1e-5)
"""Without a learning rate, in which members may differ."""
_TINY = 1e-6


class Parameters(NamedTuple):
    """What the optimiser changes."""

    policy: Network
    critic: Network
    log_std: Array
    """Logarithm of the actions' deviation, (outputs,); unused where actions are choices."""


class Member(NamedTuple):
    """One member of a population, between two updates."""

    parameters: Parameters
    optimiser: Any
    observations: Statistics
    """Of observations, (n,)."""
    returns: Statistics
    """Of discounted returns, ()."""
    discounted: Array
    """Return of the running episodes so far, discounted as if time ran backwards, (N,)."""
    key: Array
    """Data of the JAX key for what is still to be drawn, (2,) uint32."""


class Rollout(NamedTuple):
    """T steps of N environments, (T, N, ...)."""

    observation: Array
    """As the environment gave it, (T, N, n)."""
    signals: Array
    """The task's, scaled by their ranges, (T, N, S)."""
    action: Array
    """In the learner's form."""
    log_prob: Array
    reward: Array
    terminated: Array
    truncated: Array
    valid: Array
    """False where a step only reset an environment."""
    reached: Array
    """The observation that the action led to; where an episode ended, its final one."""
    reached_signals: Array


@dataclass(frozen=True, eq=False)
class Shape:
    """What compiled functions must know: everything that members share."""

    settings: Settings
    observation: int
    """Components of an observation."""
    signals: int
    """Numbers that the task's signals have together."""
    actions: BoxActions | DiscreteActions

    def make(self, seed: int) -> Member:
        """A member that has learned nothing."""
        s = self.settings
        # Child seeds, so that no draw of one purpose is that of another.
        of_policy, of_critic, of_key = np.random.SeedSequence(seed).spawn(3)
        seen = self.observation + self.signals * s.critic_signals
        parameters = Parameters(
            policy=make_network(
                np.random.default_rng(of_policy),
                (self.observation, *s.net_arch, self.actions.outputs),
                0.01,
            ),
            critic=make_network(np.random.default_rng(of_critic), (seen, *s.net_arch, 1), 1.0),
            log_std=jnp.full(self.actions.outputs, s.log_std_init, jnp.float32),
        )
        return Member(
            parameters=parameters,
            optimiser=OPTIMISER.init(parameters),
            observations=unseen((self.observation,)),
            returns=unseen(()),
            discounted=jnp.zeros(s.environments),
            key=jnp.asarray(of_key.generate_state(2, np.uint32)),
        )

    def weights(self, parameters: Mapping[str, Any], steps: int) -> Weights:
        """The hyper-parameters that are not shapes, of one member.

        Args:
            parameters: All hyper-parameters.
            steps: Environment steps of the whole training, for schedules.
        """
        rate = parameters["learning_rate"]
        start = start_of(rate) if isinstance(rate, str) else None
        values = {
            **{name: parameters[name] for name in Weights._fields if name in parameters},
            "learning_rate": rate if start is None else start,
            "decay": 0.0 if start is None else 1 / steps,
        }
        return Weights(**{name: jnp.asarray(value, jnp.float32) for name, value in values.items()})

    def seen(self, member: Member, observation: Array) -> Array:
        """What the policy's network is given."""
        if self.settings.normalize_observations:
            return member.observations.normalised(observation)
        return observation

    def act(self, member: Member, observation: Array, noise: Array) -> tuple[Array, Array]:
        """Actions in the learner's form, and the logarithms of their probabilities."""
        parameters = member.parameters
        outputs = apply(parameters.policy, self.seen(member, observation))
        action = self.actions.draw(outputs, parameters.log_std, noise)
        return action, self.actions.log_prob(outputs, parameters.log_std, action)

    def best(self, member: Member, observation: Array) -> Array:
        """The most likely actions, as the environment takes them."""
        outputs = apply(member.parameters.policy, self.seen(member, observation))
        return self.actions.for_environment(self.actions.mode(outputs))

    def _critic_sees(self, seen: Array, signals: Array) -> Array:
        return jnp.concatenate([seen, signals], -1) if self.settings.critic_signals else seen

    def silence(self) -> dict[str, Array]:
        """What is told of updates before the first one: zeros, in the form of `update`'s."""
        names = [*Report._fields, "explained_variance", "learning_rate", "reward_scale"]
        names += ["std"] * isinstance(self.actions, BoxActions)
        return {name: jnp.zeros(()) for name in names}

    def update(
        self, member: Member, rollout: Rollout, weights: Weights, made: Array
    ) -> tuple[Member, dict[str, Array]]:
        """The member after the epochs of one rollout, and scalars about it.

        Observations are normalised throughout as they were when the actions were drawn, so that the
        first minibatch's ratio is 1; the rollout counts from the next one on.

        Args:
            member: Before.
            rollout: Made by this member.
            weights: Hyper-parameters.
            made: Environment steps before the rollout, ().
        """
        member, scale = self._scaled(member, rollout, weights)
        batch, values = self._batch(member, rollout, weights, scale)
        rate = weights.learning_rate * jnp.maximum(1 - weights.decay * made, 0)
        member, report = self._epochs(member, batch, weights, rate)
        observations = member.observations.updated(rollout.observation, rollout.valid)
        member = member._replace(observations=observations)
        scalars = report._asdict()
        explained = _explained(batch.target.ravel(), values.ravel(), batch.valid.ravel())
        scalars |= {"explained_variance": explained, "learning_rate": rate, "reward_scale": scale}
        if isinstance(self.actions, BoxActions):
            scalars["std"] = jnp.mean(jnp.exp(member.parameters.log_std))
        return member, scalars

    def _scaled(self, member: Member, rollout: Rollout, weights: Weights) -> tuple[Member, Array]:
        """The member that knows a rollout's returns, and what its rewards are divided by."""
        ended = rollout.terminated | rollout.truncated

        def later(before: Array, step: tuple[Array, Array, Array]) -> tuple[Array, Array]:
            reward, ended, valid = step
            now = jnp.where(valid, before * weights.gamma + reward, before)
            return jnp.where(ended, 0.0, now), now

        steps = (rollout.reward, ended, rollout.valid)
        discounted, returns = jax.lax.scan(later, member.discounted, steps)
        member = member._replace(
            discounted=discounted, returns=member.returns.updated(returns, rollout.valid)
        )
        if not self.settings.scale_reward:
            return member, jnp.ones(())
        return member, member.returns.deviation

    def _batch(
        self, member: Member, rollout: Rollout, weights: Weights, scale: Array
    ) -> tuple[Batch, Array]:
        """The transitions with advantages and targets, (T, N, ...), and the critic's values."""
        critic = member.parameters.critic
        seen = self.seen(member, rollout.observation)
        sees = self._critic_sees(seen, rollout.signals)
        values = apply(critic, sees)[..., 0]
        reached = self.seen(member, rollout.reached)
        next_values = apply(critic, self._critic_sees(reached, rollout.reached_signals))[..., 0]
        terminated = rollout.terminated
        if self.settings.horizon_is_terminal:
            terminated = terminated | rollout.truncated
        rewards = rollout.reward
        if self.settings.scale_reward:
            rewards = jnp.clip(rewards / scale, -LARGEST, LARGEST)
        advantage = advantages(
            rewards,
            values,
            next_values,
            terminated,
            rollout.truncated,
            rollout.valid,
            gamma=weights.gamma,
            gae_lambda=weights.gae_lambda,
        )
        batch = Batch(
            observation=seen,
            critic=sees,
            action=rollout.action,
            log_prob=rollout.log_prob,
            advantage=advantage,
            target=advantage + values,
            valid=rollout.valid,
        )
        return batch, values

    def _epochs(
        self, member: Member, batch: Batch, weights: Weights, rate: Array
    ) -> tuple[Member, Report]:
        """The member after all minibatches, and the mean of their reports."""
        s = self.settings
        flat = jax.tree.map(lambda x: x.reshape(s.rollout, *x.shape[2:]), batch)
        key, shuffle = jax.random.split(jax.random.wrap_key_data(member.key))
        orders = jax.vmap(lambda one: jax.random.permutation(one, s.rollout))(
            jax.random.split(shuffle, s.n_epochs)
        ).reshape(-1, s.batch_size)

        def minibatch(carry: tuple[Parameters, Any], rows: Array) -> tuple[Any, Report]:
            parameters, optimiser = carry
            some = jax.tree.map(lambda x: x[rows], flat)
            parameters, optimiser, report = self.step(parameters, optimiser, some, weights, rate)
            return (parameters, optimiser), report

        start = (member.parameters, member.optimiser)
        (parameters, optimiser), reports = jax.lax.scan(minibatch, start, orders)
        member = member._replace(
            parameters=parameters, optimiser=optimiser, key=jax.random.key_data(key)
        )
        return member, jax.tree.map(jnp.mean, reports)

    def step(
        self, parameters: Parameters, optimiser: Any, batch: Batch, weights: Weights, rate: Array
    ) -> tuple[Parameters, Any, Report]:
        """One step of the optimiser on a minibatch."""
        if self.settings.normalize_advantage:
            batch = batch._replace(advantage=normalised(batch.advantage, batch.valid))
        gradient, report = jax.grad(self.loss, has_aux=True)(parameters, batch, weights)
        length = jnp.sqrt(sum(jnp.sum(g * g) for g in jax.tree.leaves(gradient)))
        shorter = jnp.minimum(1.0, weights.max_grad_norm / (length + _TINY))
        gradient = jax.tree.map(lambda g: g * shorter, gradient)
        direction, optimiser = OPTIMISER.update(gradient, optimiser)
        parameters = jax.tree.map(lambda p, d: p - rate * d, parameters, direction)
        return parameters, optimiser, report

    def loss(self, parameters: Parameters, batch: Batch, weights: Weights) -> tuple[Array, Report]:
        """The loss of a minibatch under some parameters."""
        outputs = apply(parameters.policy, batch.observation)
        values = apply(parameters.critic, batch.critic)[..., 0]
        log_prob = self.actions.log_prob(outputs, parameters.log_std, batch.action)
        entropy = self.actions.entropy(outputs, parameters.log_std)
        return loss(log_prob, entropy, values, batch, weights)


def _explained(targets: Array, values: Array, valid: Array) -> Array:
    """Share of the targets' variance that the critic explains; NaN where there is none."""
    number = jnp.maximum(jnp.sum(valid), 1)

    def variance(x: Array) -> Array:
        mean = jnp.sum(jnp.where(valid, x, 0)) / number
        return jnp.sum(jnp.where(valid, (x - mean) ** 2, 0)) / number

    return 1 - variance(targets - values) / variance(targets)
