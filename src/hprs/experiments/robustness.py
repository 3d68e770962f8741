"""Runs a driving policy under perturbations: many points and episodes in one compiled program."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import jax
import numpy as np
from jax import Array

from hprs.envs.driving.simulation import Simulation
from hprs.envs.simulated import draw_key
from hprs.experiments.perturbations import Conditions, Point, stacked
from hprs.semantics.assessment import Assessment, assess
from hprs.training.device import DeviceEnvironment, Running
from hprs.training.policies import BatchedPolicy

ROWS = 160
"""Episodes that one compiled step advances together, about."""


@dataclass(frozen=True)
class _Under:
    """A simulation whose episodes run under some conditions."""

    simulation: Simulation
    track: Array | np.ndarray | None

    def reset(self, key: Array) -> Any:
        return self.simulation.reset(key, self.track)

    def step(self, state: Any, action: Array) -> Any:
        return self.simulation.step(state, action)


def assessments(
    environment: DeviceEnvironment,
    simulation: Simulation,
    policy: BatchedPolicy,
    points: Sequence[Point],
    seeds: Sequence[int],
) -> Iterator[list[list[Assessment]]]:
    """Run the same seeded episodes at every point.

    Seeds draw what they draw in `hprs.training.evaluation.evaluate`: at a point that changes
    nothing the episodes are those of `hprs evaluate`, up to rounding.

    Args:
        environment: Task and reward on the simulation.
        simulation: What is driven.
        policy: What drives.
        points: Where; all of them name a track, or none does.
        seeds: One an episode.

    Yields:
        For some more points, the assessments of their episodes in the order of the seeds.
    """
    keys = np.stack([draw_key(np.random.default_rng(seed)) for seed in seeds])
    together = max(1, min(len(points), ROWS // len(seeds)))
    for start in range(0, len(points), together):
        chosen = points[start : start + together]
        # Filled up with its last point, so that one program serves all.
        filled = [*chosen, *[chosen[-1]] * (together - len(chosen))]
        values, ended = _run(environment, simulation, policy, stacked(filled), keys)
        yield [
            [_assessed(environment, values, ended, point, row) for row in range(len(seeds))]
            for point in range(len(chosen))
        ]


def _run(
    environment: DeviceEnvironment,
    simulation: Simulation,
    policy: BatchedPolicy,
    conditions: Conditions,
    keys: np.ndarray,
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Signals (T + 1, P, E, ...) and, after each step, which episodes have ended (T, P, E)."""
    running, first = _reset(environment, simulation, conditions, keys)
    found: list[dict[str, Any]] = [jax.device_get(first)]
    ended: list[np.ndarray] = []
    over = np.zeros(running.length.shape, bool)
    while not over.all():
        seen = np.asarray(running.observation)
        actions = policy.batch(list(seen.reshape(-1, seen.shape[-1])))
        actions = np.asarray(actions, np.float32).reshape(*over.shape, -1)
        running, values, now = _step(environment, simulation, conditions, running, actions)
        found.append(jax.device_get(values))
        over = over | np.asarray(now)
        ended.append(over)
    names = found[0].keys()
    return {name: np.stack([one[name] for one in found]) for name in names}, np.stack(ended)


def _assessed(
    environment: DeviceEnvironment,
    values: dict[str, np.ndarray],
    ended: np.ndarray,
    point: int,
    row: int,
) -> Assessment:
    """The assessment of one episode, up to the step with which it ended."""
    states = int(np.argmax(ended[:, point, row])) + 2
    episode = {name: value[:states, point, row] for name, value in values.items()}
    return assess(environment.task, episode)


def _under(simulation: Simulation, conditions: Conditions) -> _Under:
    settings = replace(simulation.settings, ranges=conditions.ranges, faults=conditions.faults)
    return _Under(replace(simulation, settings=settings), conditions.track)


@partial(jax.jit, static_argnums=0)
def _reset(
    environment: DeviceEnvironment, simulation: Simulation, conditions: Conditions, keys: Array
) -> tuple[Running, dict[str, Array]]:
    def of_point(one: Conditions) -> Running:
        return environment.reset(_under(simulation, one), keys)

    running = jax.vmap(of_point)(conditions)
    return running, environment.scale.by_name(running.signals)


@partial(jax.jit, static_argnums=0)
def _step(
    environment: DeviceEnvironment,
    simulation: Simulation,
    conditions: Conditions,
    running: Running,
    actions: Array,
) -> tuple[Running, dict[str, Array], Array]:
    def of_point(
        one: Conditions, running: Running, actions: Array
    ) -> tuple[Running, dict[str, Array], Array]:
        running, made = environment.step(_under(simulation, one), running, actions)
        names = environment.scale.names
        values = {name: made.values[name] for name in names}
        return running, values, made.terminated | made.truncated

    return jax.vmap(of_point)(conditions, running, actions)
