"""Environments that are JAX functions, with a task on them, many at once and without Python.

An environment is trained so if its unwrapped object has an attribute `simulation`, which is a
`hprs.envs.simulated.Simulation`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from hprs.envs.simulated import Simulation
from hprs.rewards.base import Reward
from hprs.semantics.assessment import assess
from hprs.semantics.evaluation import carry, evaluate
from hprs.semantics.plan import plan_of
from hprs.spec.task import ENV_REWARD, Task
from hprs.training.evaluation import Episode
from hprs.training.signal_scale import SignalScale
from hprs.wrappers.signals import Reader

SHORTEST = 8
"""Steps of an episode: new ones are made in stock, one for so many steps of each environment. Where
episodes are shorter than that, the stock of a rollout begins from its first again."""


class Running(NamedTuple):
    """N running episodes."""

    state: Any
    """Of the simulation, leaves (N, ...)."""
    observation: Array
    """(N, n)."""
    signals: Array
    """Raw, (N, S)."""
    memory: Any
    """Of the reward, leaves (N, ...)."""
    action: Array
    """The last one, (N, m)."""
    decided: Array
    """Whether the task has decided the episode, (N,) bool."""
    length: Array
    """Steps so far, (N,) int32."""


class Step(NamedTuple):
    """What a step of N environments led to, (N, ...)."""

    reward: Array
    terminated: Array
    truncated: Array
    observation: Array
    """Of the state reached, which where an episode ended is its last one."""
    signals: Array
    """Raw, of the same state."""
    values: dict[str, Array]
    """The same by name."""


@dataclass(frozen=True, eq=False)
class DeviceEnvironment:
    """A task and a reward on a simulation; the simulation itself is an argument."""

    task: Task
    reward: Reward
    reader: Reader
    """Reads the task's signals."""
    scale: SignalScale
    zero_action: Array
    """What counts as the action before the first one, (m,)."""
    horizon: int
    """Steps after which an episode is truncated."""

    def reset(self, simulation: Simulation, keys: Array) -> Running:
        """New episodes.

        Args:
            simulation: What is simulated.
            keys: Data of N JAX keys, (N, 2).
        """
        state, observation, signals = jax.vmap(simulation.reset)(jax.random.wrap_key_data(keys))
        number = len(keys)
        action = jnp.broadcast_to(self.zero_action, (number, *self.zero_action.shape))
        values = self.reader.at_reset(observation, action, {"signals": signals})
        values = self._as_arrays(values, number)
        evaluation = evaluate(self.task, values)
        carry(values, self.task, evaluation)
        values[ENV_REWARD] = jnp.zeros(number)
        return Running(
            state=state,
            observation=observation,
            signals=self.scale.stacked(values),
            memory=self.reward.init(values),
            action=action,
            decided=self._decides(evaluation.satisfied),
            length=jnp.zeros(number, jnp.int32),
        )

    def step(self, simulation: Simulation, running: Running, action: Array) -> tuple[Running, Step]:
        """All episodes one step on, without resets.

        Args:
            simulation: What is simulated.
            running: The episodes.
            action: As the environment takes it, (N, m).
        """
        advance = jax.vmap(lambda state, action: simulation.step(state, action))
        state, observation, signals, env_reward, terminated, truncated = advance(
            running.state, action
        )
        number = len(running.length)
        values = self.reader(observation, action, running.action, {"signals": signals})
        values = self._as_arrays(values, number)
        evaluation = evaluate(self.task, values)
        decided = running.decided | self._decides(evaluation.satisfied)
        length = running.length + 1
        terminated, truncated = terminated | decided, truncated | (length >= self.horizon)
        named = dict(values)
        carry(values, self.task, evaluation)
        values[ENV_REWARD] = env_reward
        memory, reward = self.reward.step(running.memory, values, terminated, truncated)
        raw = self.scale.stacked(values)
        running = Running(state, observation, raw, memory, action, decided, length)
        return running, Step(reward, terminated, truncated, observation, raw, named)

    def _decides(self, satisfied: Array) -> Array:
        """Whether states end their episodes: safety violated, or a target achieved."""
        plan = plan_of(self.task)
        decided = jnp.any(~satisfied[: plan.safety_count], axis=0)
        return decided | satisfied[plan.safety_count] if plan.achieves else decided

    def _as_arrays(self, values: dict[str, Any], number: int) -> dict[str, Any]:
        """Every signal as an array with the batch first; constants of s_0 are not yet."""
        found: dict[str, Any] = {}
        for name, length in zip(self.scale.names, self.scale.lengths, strict=True):
            shape = (number,) if length is None else (number, length)
            found[name] = jnp.broadcast_to(jnp.asarray(values[name], float), shape)
        return found


class Stock(NamedTuple):
    """New episodes for those that end: R for each environment."""

    episodes: Running
    """Leaves (N, R, ...)."""
    used: Array
    """How many each environment has begun, (N,) int32."""


def stock(
    environment: DeviceEnvironment, simulation: Simulation, key: Array, number: int, steps: int
) -> Stock:
    """Enough new episodes for some steps."""
    each = -(-steps // SHORTEST)
    keys = jax.random.key_data(jax.random.split(key, number * each))
    episodes = environment.reset(simulation, keys)
    shaped = jax.tree.map(lambda leaf: leaf.reshape(number, each, *leaf.shape[1:]), episodes)
    return Stock(shaped, jnp.zeros(number, jnp.int32))


def renewed(running: Running, ended: Array, fresh: Stock) -> tuple[Running, Stock]:
    """The running episodes with new ones where they have ended."""

    def chosen() -> Running:
        rows = jnp.arange(len(ended))
        column = fresh.used % fresh.episodes.length.shape[1]
        pick = partial(_replaced, ended=ended, rows=rows, column=column)
        return jax.tree.map(pick, running, fresh.episodes)

    # Most steps end no episode: then nothing is copied.
    running = jax.lax.cond(jnp.any(ended), chosen, lambda: running)
    return running, fresh._replace(used=fresh.used + ended)


def _replaced(old: Array, new: Array, *, ended: Array, rows: Array, column: Array) -> Array:
    wide = ended.reshape(-1, *(1,) * (old.ndim - 1))
    return jnp.where(wide, new[rows, column], old)


class Traces(NamedTuple):
    """Episodes from their first state on, time first."""

    values: dict[str, Array]
    """Signal to raw values, (horizon + 1, E, ...); the first `length` + 1 are of the episode."""
    length: Array
    """Steps of each episode, (E,) int32."""
    total: Array
    """Undiscounted return of each, (E,)."""


def trace(
    environment: DeviceEnvironment,
    simulation: Simulation,
    policy: Callable[[Array], Array],
    keys: Array,
) -> Traces:
    """One episode a key under a policy.

    Args:
        environment: Task and reward.
        simulation: What is simulated.
        policy: Observations (E, n) to actions as the environment takes them.
        keys: Data of E JAX keys.
    """
    running = environment.reset(simulation, keys)
    number, horizon = len(keys), environment.horizon
    first = environment.scale.by_name(running.signals)
    values = jax.tree.map(
        lambda value: jnp.zeros((horizon + 1, *value.shape), value.dtype).at[0].set(value), first
    )
    alive = jnp.ones(number, bool)
    start = (jnp.int32(0), running, alive, Traces(values, running.length, jnp.zeros(number)))

    def goes_on(carry: tuple[Array, Running, Array, Traces]) -> Array:
        return jnp.any(carry[2])

    def step(carry: tuple[Array, Running, Array, Traces]) -> tuple[Array, Running, Array, Traces]:
        time, running, alive, found = carry
        running, made = environment.step(simulation, running, policy(running.observation))
        found = Traces(
            jax.tree.map(lambda all_, now: all_.at[time + 1].set(now), found.values, made.values),
            found.length + alive,
            found.total + jnp.where(alive, made.reward, 0.0),
        )
        return time + 1, running, alive & ~(made.terminated | made.truncated), found

    return jax.lax.while_loop(goes_on, step, start)[3]


def episodes_of(task: Task, traces: Traces, seeds: Sequence[int], first: int = 0) -> list[Episode]:
    """The assessed episodes of some seeds, from row `first` on."""
    found: list[Episode] = []
    for row, seed in enumerate(seeds, first):
        length = int(traces.length[row])
        values = {name: all_[: length + 1, row] for name, all_ in traces.values.items()}
        found.append(Episode(seed, float(traces.total[row]), assess(task, values)))
    return found
