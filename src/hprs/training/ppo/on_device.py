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

from hprs.envs.driving.single import draw_key
from hprs.semantics.assessment import assess
from hprs.training.configuration import Configuration
from hprs.training.device import (
    DeviceEnvironment,
    Running,
    Simulation,
    Stock,
    Traces,
    renewed,
    stock,
    trace,
)
from hprs.training.evaluation import Episode
from hprs.training.ppo.learner import Member, Rollout, Shape
from hprs.training.ppo.learner_session import STATE, LearnerSession, horizon_of
from hprs.training.ppo.losses import Weights
from hprs.training.signal_scale import signal_scale
from hprs.training.trees import pack_tree, unpack_tree
from hprs.wrappers.signals import make_reader, zero_action
from hprs.wrappers.single import TaskWrapper

STEPS_A_CALL = 2**16
"""Environment steps of a compiled call: whoever watches hears of the progress after each."""


class State(NamedTuple):
    """A member with its running episodes."""

    member: Member
    running: Running
    updates: Array
    """Made so far, () int32."""


def begin(
    shape: Shape, environment: DeviceEnvironment, simulation: Simulation, seed: Array
) -> State:
    """A member that has learned nothing, and room for its episodes: its first rollout begins them.

    Args:
        shape: What is common to all members.
        environment: Task and reward.
        simulation: What is simulated.
        seed: JAX key.
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
        member, scalars = shape.update(state.member, rollout, weights, state.updates)
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


class DeviceSession(LearnerSession):
    """A training whose environments are JAX functions.

    Args:
        configuration: What to train.
        environment: The wrapped environment, for its spaces and horizon.
        simulation: Its functions.
    """

    def __init__(
        self, configuration: Configuration, environment: TaskWrapper, simulation: Simulation
    ) -> None:
        scale = signal_scale(configuration.task)
        super().__init__(configuration, environment, scale)
        self._configuration, self._simulation = configuration, simulation
        self._environment = DeviceEnvironment(
            task=configuration.task,
            reward=environment.reward,
            reader=make_reader(
                configuration.task, environment.observation_space, environment.action_space
            ),
            scale=scale,
            zero_action=jnp.asarray(zero_action(environment.action_space)),
            horizon=horizon_of(environment),
        )
        begun = jax.jit(partial(begin, self.shape, self._environment))
        self._state: State = begun(simulation, jax.random.key(configuration.seed))
        self._trace = jax.jit(self._traced)
        # Beside the first evaluation, which comes first and is compiled too.
        beside = ThreadPoolExecutor(1, "compilation")
        self._compiling = beside.submit(self._compiled)
        beside.shutdown(wait=False)

    @property
    def member(self) -> Member:
        """What has been learned so far."""
        return self._state.member

    @property
    def step(self) -> int:
        """Environment steps so far."""
        return int(self._state.updates) * self.shape.settings.rollout

    def restore(self, contents: Mapping[str, bytes]) -> list[str]:
        """Go on from a capture: with running episodes and random numbers as they were."""
        self._state = unpack_tree(contents[STATE], self._state)
        return []

    def capture(self) -> dict[str, bytes]:
        """The whole state."""
        return {STATE: pack_tree(self._state)}

    def advance(self, until: int) -> None:
        """As many updates as it takes, but no more than a call should take."""
        rollout = self.shape.settings.rollout
        wanted = -(-(until - self.step) // rollout)
        number = max(1, min(wanted, STEPS_A_CALL // rollout))
        self._state, scalars = self._compiling.result()(
            self._simulation, self._state, self.weights, jnp.int32(number)
        )
        self.told(scalars)

    def evaluate(self, seeds: Sequence[int], watch: Callable[[int], None]) -> list[Episode]:
        """All episodes in one compiled call; those of the Gymnasium environment, to 1e-5."""
        keys = np.stack([draw_key(np_random(seed)[0]) for seed in seeds])
        found = jax.device_get(self._trace(self._simulation, self.member, keys))
        watch(len(seeds))
        episodes: list[Episode] = []
        for index, seed in enumerate(seeds):
            length = int(found.length[index])
            values = {name: all_[: length + 1, index] for name, all_ in found.values.items()}
            assessment = assess(self._configuration.task, values)
            episodes.append(Episode(seed, float(found.total[index]), assessment))
        return episodes

    def _compiled(self) -> Any:
        function = jax.jit(partial(train, self.shape, self._environment), donate_argnums=1)
        once = jnp.int32(1)
        return function.lower(self._simulation, self._state, self.weights, once).compile()

    def _traced(self, simulation: Simulation, member: Member, keys: Array) -> Traces:
        return trace(self._environment, simulation, partial(self.shape.best, member), keys)
