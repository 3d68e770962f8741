"""SAC on environments that are JAX functions: stepping and learning are one compiled program."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from hprs.training.device import DeviceEnvironment, Running, Simulation, Step
from hprs.training.frames import Frames
from hprs.training.sac.buffer import Buffer, added, empty, frame_of, sampled
from hprs.training.sac.learner import Member, Report, Shape, Weights

_BEGINNING = 2**32 - 1
"""What the key of the first episodes is folded with: no number of rounds."""

CHUNK = 32
"""Rounds whose random numbers are drawn together: inside a loop XLA would draw them anew."""


class State(NamedTuple):
    """A population with its running episodes and what it remembers."""

    members: Member
    """Leaves (M, ...)."""
    running: Running
    """The members' environments one after the other, leaves (M * N, ...)."""
    buffer: Buffer
    rounds: Array
    """Made so far, () int32."""


class Draws(NamedTuple):
    """All that is random in a round, of every member, (M, ...)."""

    noise: Array
    """Of actions, (M, T, N, m)."""
    anything: Array
    """Actions before learning starts, (M, T, N, m)."""
    resets: Array
    """Data of keys of new episodes, (M, T, N, 2)."""
    bits: Array
    """That choose transitions, (M, G, B)."""
    update: Array
    """Noise of updates, (M, G, 2, B, m)."""


def draw(shape: Shape, key: Array, rounds: Array) -> Draws:
    """The random numbers of a member's next `CHUNK` rounds, (CHUNK, ...)."""
    s, outputs = shape.settings, shape.actions.outputs
    keys = jax.random.split(jax.random.fold_in(jax.random.wrap_key_data(key), rounds), 5)
    steps = CHUNK, s.train_freq, s.environments
    updates = CHUNK, s.gradient_steps
    return Draws(
        noise=jax.random.normal(keys[0], (*steps, outputs)),
        anything=jax.random.uniform(keys[1], (*steps, outputs), minval=-1.0, maxval=1.0),
        resets=jax.random.bits(keys[2], (*steps, 2)),
        bits=jax.random.bits(keys[3], (*updates, s.batch_size)),
        update=jax.random.normal(keys[4], (*updates, 2, s.batch_size, outputs)),
    )


def begin(
    shape: Shape,
    environment: DeviceEnvironment,
    frames: Frames,
    simulation: Simulation,
    members: Member,
) -> State:
    """A population that has learned nothing, in its first episodes.

    Args:
        shape: What is common to all members.
        environment: Task and rewards.
        frames: Of observations.
        simulation: What is simulated.
        members: Leaves (M, ...).
    """
    number = len(members.key)

    def keys(key: Array) -> Array:
        first = jax.random.fold_in(jax.random.wrap_key_data(key), _BEGINNING)
        return jax.random.bits(first, (shape.settings.environments, 2))

    rows = number * shape.settings.environments
    running = environment.reset(simulation, jax.vmap(keys)(members.key).reshape(rows, 2))
    capacity = shape.settings.buffer_size // shape.settings.environments
    buffer = empty(capacity, rows, frames, shape.actions.outputs)
    return State(members, running, buffer, jnp.zeros((), jnp.int32))


def train(
    shape: Shape,
    environment: DeviceEnvironment,
    frames: Frames,
    simulation: Simulation,
    state: State,
    weights: Weights,
    chunks: Array,
) -> tuple[State, Report]:
    """Some chunks of rounds; the report is that of the last update.

    Args:
        shape: What is common to all members.
        environment: Task and rewards.
        frames: Of observations.
        simulation: What is simulated.
        state: Where the training stands.
        weights: Hyper-parameters of each member, (M,).
        chunks: How many, (), at least 1.
    """
    last = state.rounds + chunks * CHUNK
    one_round = partial(play_round, shape, environment, frames, simulation, weights)

    def chunk(carry: tuple[State, Report]) -> tuple[State, Report]:
        state, report = carry
        draws = jax.vmap(partial(draw, shape), (0, None))(state.members.key, state.rounds)
        draws = jax.tree.map(lambda x: jnp.moveaxis(x, 1, 0), draws)
        (state, report), _ = jax.lax.scan(
            lambda carry, drawn: (one_round(*carry, drawn), None), (state, report), draws
        )
        return state, report

    silence = Report(*[jnp.zeros(len(state.members.key))] * len(Report._fields))
    return jax.lax.while_loop(lambda carry: carry[0].rounds < last, chunk, (state, silence))


def play_round(
    shape: Shape,
    environment: DeviceEnvironment,
    frames: Frames,
    simulation: Simulation,
    weights: Weights,
    state: State,
    report: Report,
    draws: Draws,
) -> tuple[State, Report]:
    """Steps of all environments, and then updates of all members."""
    s, number = shape.settings, len(state.members.key)

    def step(
        carry: tuple[Running, Buffer, Array], drawn: tuple[Array, Array, Array]
    ) -> tuple[tuple[Running, Buffer, Array], None]:
        running, buffer, count = carry
        noise, anything, resets = drawn
        observation = running.observation.reshape(number, s.environments, -1)
        action = of_members(shape.act)(state.members, observation, noise)
        action = jnp.where(count * s.environments < s.learning_starts, anything, action)
        action = action.reshape(number * s.environments, -1)
        reached, made = environment.step(simulation, running, shape.actions.for_environment(action))
        buffer = added(buffer, _row(running, action, made, frames), count)
        running = _renewed(environment, simulation, reached, made, resets.reshape(-1, 2))
        return (running, buffer, count + 1), None

    stepping = jax.tree.map(
        lambda x: jnp.moveaxis(x, 1, 0), (draws.noise, draws.anything, draws.resets)
    )
    count = state.rounds * s.train_freq
    (running, buffer, count), _ = jax.lax.scan(step, (state.running, state.buffer, count), stepping)
    made = count * s.environments

    def update(
        carry: tuple[Member, Report], drawn: tuple[Array, Array]
    ) -> tuple[tuple[Member, Report], None]:
        members, _ = carry
        bits, noise = drawn
        batch = sampled(buffer, frames, bits, count, number)
        steps = jnp.broadcast_to(made.astype(jnp.float32), (number,))
        return of_members(shape.update)(members, batch, noise, weights, steps), None

    def updates() -> tuple[Member, Report]:
        drawn = jax.tree.map(lambda x: jnp.moveaxis(x, 1, 0), (draws.bits, draws.update))
        return jax.lax.scan(update, (state.members, report), drawn)[0]

    members, report = jax.lax.cond(
        made > s.learning_starts, updates, lambda: (state.members, report)
    )
    return State(members, running, buffer, state.rounds + 1), report


def of_members(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of one member as one of all of them, on the first axis of its arguments.

    One alone is computed without the axis; several one after the other on a CPU, whose cores share
    the work inside of a matrix product, and at once elsewhere.
    """

    def of_all(*arguments: Any) -> Any:
        number = len(jax.tree.leaves(arguments[0])[0])
        if number == 1:
            alone = jax.tree.map(lambda leaf: leaf[0], arguments)
            return jax.tree.map(lambda leaf: leaf[None], function(*alone))
        if jax.default_backend() == "cpu":
            return jax.lax.map(lambda one: function(*one), arguments)
        return jax.vmap(function)(*arguments)

    return of_all


def _row(running: Running, action: Array, made: Step, frames: Frames) -> Buffer:
    return Buffer(
        frame=frame_of(running.observation, frames),
        reached=frame_of(made.observation, frames),
        action=action,
        reward=made.reward,
        terminated=made.terminated,
        truncated=made.truncated,
        valid=jnp.ones_like(made.terminated),
        age=jnp.minimum(running.length, frames.depth).astype(jnp.uint8),
    )


def _renewed(
    environment: DeviceEnvironment,
    simulation: Simulation,
    reached: Running,
    made: Step,
    resets: Array,
) -> Running:
    """The running episodes with new ones where they have ended."""
    ended = made.terminated | made.truncated

    def replaced(old: Array, new: Array) -> Array:
        return jnp.where(ended.reshape(-1, *(1,) * (old.ndim - 1)), new, old)

    def renew() -> Running:
        return jax.tree.map(replaced, reached, environment.reset(simulation, resets))

    # Most steps end no episode.
    return jax.lax.cond(jnp.any(ended), renew, lambda: reached)
