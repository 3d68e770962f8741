"""Runs a driving policy under perturbations: many points and episodes in one compiled program."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import jax
import numpy as np
from jax import Array

from hprs.carsim.track import Track, stack_tracks
from hprs.envs.driving.simulation import Simulation
from hprs.envs.simulated import draw_key
from hprs.experiments.perturbations import (
    Conditions,
    NamedTrack,
    Point,
    points,
    stacked,
    track_points,
)
from hprs.experiments.robustness_result import Row, rows_of
from hprs.semantics.assessment import Assessment, assess
from hprs.training.compilation import keep_compiled_programs
from hprs.training.device import DeviceEnvironment, Running
from hprs.training.policies import BatchedPolicy
from hprs.training.simulations import device_environment, simulation_of
from hprs.wrappers.single import TaskWrapper

ROWS = 160
"""Episodes that one compiled step advances together, about."""


@dataclass(frozen=True)
class _Under:
    """A simulation whose episodes run under some conditions."""

    simulation: Simulation
    track: Array | None

    def reset(self, key: Array) -> Any:
        return self.simulation.reset(key, self.track)  # type: ignore[arg-type]

    def step(self, state: Any, action: Array) -> Any:
        return self.simulation.step(state, action)


def try_policies(
    name: str,
    make: Callable[[], TaskWrapper],
    policies: Mapping[str, Any],
    *,
    seen: Sequence[str],
    sweeps: Mapping[str, Sequence[float]],
    ground: Track | None,
    tracks: Sequence[NamedTrack],
    seeds: Sequence[int],
    watcher: Callable[[str], Callable[[int], None]],
) -> list[Row]:
    """Test the policies of one training, whose episodes are pooled.

    Args:
        name: What the training is called.
        make: Makes the environment as it was in the training.
        policies: By the names of their seeds.
        seen: Names of the tracks of the training.
        sweeps: Name of a perturbation to its values.
        ground: A stack of the tracks on which these are driven; None: those of the training.
        tracks: Tracks to drive on, besides.
        seeds: Of the episodes at every point.
        watcher: Gives what is told how many episodes of a policy are complete.

    Raises:
        UsageError: There is no such perturbation, or a value is impossible.
    """
    keep_compiled_programs()
    wrapped = make()
    simulation = simulation_of(wrapped)
    environment = device_environment(wrapped.task, wrapped.reward, wrapped)
    wrapped.close()
    swept = simulation if ground is None else replace(simulation, tracks=ground)
    groups = [(swept, points(simulation.settings, sweeps))]
    if tracks:
        stack = stack_tracks([each.track for each in tracks])
        on_tracks = track_points(simulation.settings, tracks, seen)
        groups.append((replace(simulation, tracks=stack), on_tracks))
    found: list[tuple[Point, list[Assessment]]] = [
        (point, []) for _, chosen in groups for point in chosen
    ]
    for seed, policy in policies.items():
        watch = watcher(f"{name}, {seed}" if len(policies) > 1 else name)
        at = 0
        for driven, chosen in groups:
            on_device = jax.device_put(driven)
            for some in assessments(environment, on_device, policy, chosen, seeds):
                for episodes in some:
                    found[at][1].extend(episodes)
                    at += 1
                watch(at * len(seeds))
    return rows_of(name, environment.task, found)


def assessments(
    environment: DeviceEnvironment,
    simulation: Simulation,
    policy: BatchedPolicy,
    chosen: Sequence[Point],
    seeds: Sequence[int],
) -> Iterator[list[list[Assessment]]]:
    """Run the same seeded episodes at every point.

    Seeds draw what they draw in `hprs.training.evaluation.evaluate`: at a point that changes
    nothing the episodes are those of `hprs evaluate`, up to rounding.

    Args:
        environment: Task and reward on the simulation.
        simulation: What is driven.
        policy: What drives.
        chosen: Where; all of them name a track, or none does.
        seeds: One an episode.

    Yields:
        For some more points, the assessments of their episodes in the order of the seeds.
    """
    keys = np.stack([draw_key(np.random.default_rng(seed)) for seed in seeds])
    together = max(1, min(len(chosen), ROWS // len(seeds)))
    for start in range(0, len(chosen), together):
        some = chosen[start : start + together]
        # Filled up with the last point, so that one program serves all.
        filled = [*some, *[some[-1]] * (together - len(some))]
        values, ended = _run(environment, simulation, policy, stacked(filled), keys)
        yield [
            [_assessed(environment, values, ended, point, row) for row in range(len(seeds))]
            for point in range(len(some))
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
