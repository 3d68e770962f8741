"""Rollouts of environments that are JAX functions: compiled with the updates, without Python."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from gymnasium.utils.seeding import np_random
from jax import Array

from hprs.envs.simulated import Simulation, draw_key
from hprs.training.configuration import Configuration
from hprs.training.device import (
    DeviceEnvironment,
    Running,
    Stock,
    Traces,
    episodes_of,
    renewed,
    stock,
    trace,
)
from hprs.training.evaluation import Episode
from hprs.training.learner_session import STATE, told
from hprs.training.ppo.learner import Member, Rollout, Shape
from hprs.training.ppo.losses import Weights
from hprs.training.ppo.ppo_session import PpoSession, holds_numbers
from hprs.training.signal_scale import signal_scale
from hprs.training.simulations import device_environment
from hprs.training.trees import one_of, pack_tree, unpack_tree
from hprs.wrappers.single import TaskWrapper

STEPS_A_CALL = 2**16
"""Environment steps of a compiled call: whoever watches hears of the progress after each."""


class State(NamedTuple):
    """A member with its running episodes."""

    member: Member
    running: Running
    updates: Array
    """Made so far, () int32."""


def begin(shape: Shape, environment: DeviceEnvironment, simulation: Simulation, seed: int) -> State:
    """A member that has learned nothing, and room for its episodes: its first rollout begins them.

    Args:
        shape: What is common to all members.
        environment: Task and reward.
        simulation: What is simulated.
        seed: Of the member.
    """
    keys = jax.ShapeDtypeStruct((shape.settings.environments, 2), jnp.uint32)
    shapes = jax.eval_shape(environment.reset, simulation, keys)
    running = jax.tree.map(lambda one: jnp.zeros(one.shape, one.dtype), shapes)
    return State(shape.make(seed), running, jnp.zeros((), jnp.int32))


def train(
    shape: Shape,
    environment: DeviceEnvironment,
    simulation: Simulation,
    state: State,
    weights: Weights,
    iterations: Array,
) -> tuple[State, dict[str, Array]]:
    """Some rollouts, each with its update; the scalars are those of the last one.

    Args:
        shape: What is common to all members.
        environment: Task and reward.
        simulation: What is simulated.
        state: Where the training stands.
        weights: Hyper-parameters.
        iterations: How many, (), at least 1.
    """

    def iteration(carry: tuple[State, Any]) -> tuple[State, dict[str, Array]]:
        state, _ = carry
        state, rollout = roll_out(shape, environment, simulation, state)
        made = (state.updates * shape.settings.rollout).astype(jnp.float32)
        member, scalars = shape.update(state.member, rollout, weights, made)
        return State(member, state.running, state.updates + 1), scalars

    last = state.updates + iterations
    start = (state, shape.silence())
    return jax.lax.while_loop(lambda carry: carry[0].updates < last, iteration, start)


def roll_out(
    shape: Shape, environment: DeviceEnvironment, simulation: Simulation, state: State
) -> tuple[State, Rollout]:
    """Steps of all environments with the member's policy; episodes that end begin anew."""
    s, member = shape.settings, state.member
    key, noise_key, stock_key = jax.random.split(jax.random.wrap_key_data(member.key), 3)
    # Before the loop: inside of one XLA draws numbers again wherever they are used.
    noise = shape.actions.noise(noise_key, (s.n_steps, s.environments))
    fresh = stock(environment, simulation, stock_key, s.environments, s.n_steps)
    everyone = jnp.ones(s.environments, bool)
    running, fresh = renewed(state.running, everyone & (state.updates == 0), fresh)
    scale = environment.scale

    def step(carry: tuple[Running, Stock], noise: Array) -> tuple[tuple[Running, Stock], Rollout]:
        running, fresh = carry
        action, log_prob = shape.act(member, running.observation, noise)
        given = shape.actions.for_environment(action)
        reached, made = environment.step(simulation, running, given)
        following, fresh = renewed(reached, made.terminated | made.truncated, fresh)
        return (following, fresh), Rollout(
            observation=running.observation,
            signals=scale(running.signals),
            action=action,
            log_prob=log_prob,
            reward=made.reward,
            terminated=made.terminated,
            truncated=made.truncated,
            valid=jnp.ones_like(made.terminated),
            reached=made.observation,
            reached_signals=scale(made.signals),
        )

    (running, _), rollout = jax.lax.scan(step, (running, fresh), noise)
    member = member._replace(key=jax.random.key_data(key))
    return state._replace(member=member, running=running), rollout


class DeviceSession(PpoSession):
    """Trainings whose environments are JAX functions, as members of one program.

    Args:
        configurations: What to train; they make one program.
        environment: The wrapped environment of the first, for its spaces and horizon.
        simulation: Its functions.
    """

    def __init__(
        self,
        configurations: Sequence[Configuration],
        environment: TaskWrapper,
        simulation: Simulation,
    ) -> None:
        first = configurations[0]
        super().__init__(first, environment, signal_scale(first.task))
        self._number, self._simulation = len(configurations), simulation
        self._environment = device_environment(first.task, environment.reward, environment)
        weights = [self.shape.weights(one.parameters, one.steps) for one in configurations]
        self._weights: Weights = jax.tree.map(lambda *values: jnp.stack(values), *weights)
        begun = [
            begin(self.shape, self._environment, simulation, one.seed) for one in configurations
        ]
        self._states: State = jax.tree.map(lambda *leaves: jnp.stack(leaves), *begun)
        self._scalars: list[dict[str, float]] = [{} for _ in configurations]
        self._pick = jax.jit(one_of)
        self._check = jax.jit(jax.vmap(holds_numbers))
        self._checked: tuple[int, np.ndarray] | None = None
        self._trace = jax.jit(_of_members(self._traced, (None, 0, None)))
        # Beside the first evaluation, which comes first and is compiled too.
        beside = ThreadPoolExecutor(1, "compilation")
        self._compiling = beside.submit(self._compiled)
        beside.shutdown(wait=False)

    @property
    def step(self) -> int:
        """Environment steps of each member so far."""
        # One that could not be restored has made none.
        return int(self._states.updates.max()) * self.shape.settings.rollout

    def learned(self, member: int) -> Member:
        """What a member has learned so far."""
        return self._pick(self._states.member, member)

    def is_finite(self, member: int) -> bool:
        """Whether its networks and statistics hold numbers; found out once a step for all."""
        if self._checked is None or self._checked[0] != self.step:
            self._checked = self.step, np.asarray(self._check(self._states.member))
        return bool(self._checked[1][member])

    def scalars(self, member: int) -> Mapping[str, float]:
        """What is told of a member's newest update."""
        return self._scalars[member]

    def restore(self, member: int, contents: Mapping[str, bytes]) -> list[str]:
        """Go on from a capture: with running episodes and random numbers as they were."""
        found = unpack_tree(contents[STATE], one_of(self._states, member))
        self._states = jax.tree.map(lambda all_, one: all_.at[member].set(one), self._states, found)
        self._checked = None
        return []

    def capture(self, member: int) -> dict[str, bytes]:
        """The whole state of a member."""
        return {STATE: pack_tree(self._pick(self._states, member))}

    def advance(self, until: int) -> None:
        """As many updates as it takes, but no more than a call should take."""
        rollout = self.shape.settings.rollout
        wanted = -(-(until - self.step) // rollout)
        number = max(1, min(wanted, STEPS_A_CALL // (rollout * self._number)))
        self._states, scalars = self._compiling.result()(
            self._simulation, self._states, self._weights, jnp.int32(number)
        )
        found = jax.device_get(scalars)
        self._scalars = [told(one_of(found, member)) for member in range(self._number)]

    def evaluate(self, seeds: Sequence[int], watch: Callable[[int], None]) -> list[list[Episode]]:
        """All episodes in one compiled call; those of the Gymnasium environment, to 1e-5."""
        keys = np.stack([draw_key(np_random(seed)[0]) for seed in seeds])
        found = jax.device_get(self._trace(self._simulation, self._states.member, keys))
        watch(len(seeds))
        # What a member that has diverged does is no episode.
        return [
            episodes_of(self._environment.task, one_of(found, member), seeds)
            if self.is_finite(member)
            else []
            for member in range(self._number)
        ]

    def close(self) -> None:
        """Nothing to close."""

    def _compiled(self) -> Any:
        trained = _of_members(partial(train, self.shape, self._environment), (None, 0, 0, None))
        lowered = jax.jit(trained, donate_argnums=1).lower(
            self._simulation, self._states, self._weights, jnp.int32(1)
        )
        return lowered.compile()

    def _traced(self, simulation: Simulation, member: Member, keys: Array) -> Traces:
        return trace(self._environment, simulation, partial(self.shape.best, member), keys)


def _of_members(function: Callable[..., Any], axes: tuple[int | None, ...]) -> Callable[..., Any]:
    """A function of one member as one of all of them, on the first axis of some arguments.

    One member alone is computed without the axis, which on a CPU costs time.
    """

    def of_all(*arguments: Any) -> Any:
        number = next(
            len(jax.tree.leaves(given)[0])
            for given, axis in zip(arguments, axes, strict=True)
            if axis == 0
        )
        if number > 1:
            return jax.vmap(function, axes)(*arguments)
        alone = [
            given if axis is None else one_of(given, 0)
            for given, axis in zip(arguments, axes, strict=True)
        ]
        return jax.tree.map(lambda leaf: leaf[None], function(*alone))

    return of_all
