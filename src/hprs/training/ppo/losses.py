"""Advantages and the loss of proximal policy optimisation (Schulman et al., 2016 and 2017)."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

_LEAST_DEVIATION = 1e-8


class Weights(NamedTuple):
    """Hyper-parameters that members of a population need not share; scalars."""

    learning_rate: Array
    """At the start of the training."""
    decay: Array
    """Share of it that an environment step takes away: 0 for a constant."""
    gamma: Array
    gae_lambda: Array
    clip_range: Array
    ent_coef: Array
    vf_coef: Array
    max_grad_norm: Array


class Batch(NamedTuple):
    """Transitions of a rollout or of a minibatch, of any batch shape (...)."""

    observation: Array
    """Normalised, (..., n)."""
    critic: Array
    """What the critic sees, (..., c)."""
    action: Array
    """(..., m), or (...) for choices."""
    log_prob: Array
    """Of the policy that drew the action, (...)."""
    advantage: Array
    """(...)."""
    target: Array
    """What the critic should have said, (...)."""
    valid: Array
    """Which transitions count, (...) bool."""


class Report(NamedTuple):
    """What is told of an update, scalars."""

    policy_loss: Array
    value_loss: Array
    entropy: Array
    approx_kl: Array
    clip_fraction: Array


def advantages(
    rewards: Array,
    values: Array,
    next_values: Array,
    terminated: Array,
    truncated: Array,
    valid: Array,
    *,
    gamma: Array | float,
    gae_lambda: Array | float,
) -> Array:
    """Generalised advantage estimates.

    A terminated episode has no future. A truncated one has the future that the critic expects of
    the state that it was cut off in, not of the next episode's first. Estimates do not reach across
    ends of episodes, nor across transitions that are not valid.

    Args:
        rewards: (T, N), as all arrays.
        values: Of the states left.
        next_values: Of the states reached; where an episode ended, its final state.
        terminated: Whether the task ended there.
        truncated: Whether the episode was cut off there.
        valid: Which transitions count; the others are only resets.
        gamma: Discount.
        gae_lambda: Decay of the estimates' memory.

    Returns:
        (T, N); 0 where a transition does not count.
    """
    errors = rewards + gamma * jnp.where(terminated, 0.0, next_values) - values
    errors = jnp.where(valid, errors, 0.0)
    kept = jnp.where(terminated | truncated | ~valid, 0.0, gamma * gae_lambda)

    def earlier(later: Array, step: tuple[Array, Array]) -> tuple[Array, Array]:
        error, keep = step
        estimate = error + keep * later
        return estimate, estimate

    return jax.lax.scan(earlier, jnp.zeros_like(values[0]), (errors, kept), reverse=True)[1]


def normalised(advantage: Array, valid: Array) -> Array:
    """Advantages with mean 0 and deviation 1 over those that count."""
    number = jnp.sum(valid)
    mean = jnp.sum(jnp.where(valid, advantage, 0.0)) / jnp.maximum(number, 1)
    squares = jnp.where(valid, (advantage - mean) ** 2, 0.0)
    deviation = jnp.sqrt(jnp.sum(squares) / jnp.maximum(number - 1, 1))
    return (advantage - mean) / (deviation + _LEAST_DEVIATION)


def loss(
    log_prob: Array,
    entropy: Array,
    values: Array,
    batch: Batch,
    weights: Weights,
) -> tuple[Array, Report]:
    """The loss of a minibatch, and its parts.

    Args:
        log_prob: Of the batch's actions under the policy that learns, (...).
        entropy: Of that policy, (...).
        values: Of the critic that learns, (...).
        batch: The minibatch; its advantages are taken as they are.
        weights: Clip range and weights of the parts.
    """
    number = jnp.maximum(jnp.sum(batch.valid), 1)

    def mean(values: Array) -> Array:
        return jnp.sum(jnp.where(batch.valid, values, 0.0)) / number

    log_ratio = log_prob - batch.log_prob
    ratio = jnp.exp(log_ratio)
    clipped = jnp.clip(ratio, 1 - weights.clip_range, 1 + weights.clip_range)
    gain = jnp.minimum(batch.advantage * ratio, batch.advantage * clipped)
    report = Report(
        policy_loss=-mean(gain),
        value_loss=mean((values - batch.target) ** 2),
        entropy=mean(entropy),
        approx_kl=mean(ratio - 1 - log_ratio),
        clip_fraction=mean((jnp.abs(ratio - 1) > weights.clip_range).astype(ratio.dtype)),
    )
    total = report.policy_loss - weights.ent_coef * report.entropy
    return total + weights.vf_coef * report.value_loss, report
