"""What scripted drivers reach in the driving benchmarks: a floor and a ceiling for PAM.

    .venv/bin/python benchmarks/drivers.py [TRACK ...]

One line is one driver on one track in one direction: 100 random starts, keys 0 to 99, with the
benchmark's own randomisation and horizon. S, S+T, S+T+C and PAM are those of `hprs evaluate`;
behind them stands the fraction of steps in which each comfort requirement holds, as a mean over all
episodes, and their mean length. Of the follower there is a second line: what its leaders do, and
what they leave to any driver. TRACK is a built-in one, `random:SEED` or a map's YAML file.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

import hprs
from hprs.carsim.actuators import MAX_SPEED_COMMAND, Command
from hprs.carsim.drivers import PursuitParameters, follow, pursue
from hprs.carsim.leader import LeaderParameters, follow_the_gap
from hprs.carsim.lidar import beam_angles
from hprs.carsim.race import CONTROL_STEP, lead_distance
from hprs.carsim.selection import selected
from hprs.carsim.track import Track, stack_tracks
from hprs.envs import functional, task_of
from hprs.envs.driving.simulation import SPEED_CHANGE, Episode, Simulation
from hprs.spec.printer import format_expression

SAFE, FOLLOW = "hprs/SafeDriving-v0", "hprs/FollowLeader-v0"
STARTS = 100
UNDER_WAY = 20
"""Control steps after which every leader has the speed at which it goes on."""
OBEYED = 1.43
"""Speed over command of the car that exceeds its commands most: what `ceilings` grants."""
CONSTANTS = {each.name: float(format_expression(each.value)) for each in task_of(FOLLOW).constants}
FAST = PursuitParameters(top_speed=2.7, lateral_acceleration=4.0)
"""2 m/s and more in every bend of the built-in tracks."""
GAP = LeaderParameters(base_speed=1.5, variable_speed=1.0)
"""A pilot that knows its own scan only."""

Driver = Callable[[Episode, Track, Array], Command]


def _car(episode: Episode, index: int) -> Any:
    return jax.tree.map(lambda leaf: leaf[index], episode.world.cars)


def _pursuit(parameters: PursuitParameters) -> Driver:
    def drive(episode: Episode, track: Track, key: Array) -> Command:
        progress = episode.world.progress[0]
        return pursue(_car(episode, 0), progress, track, parameters=parameters)

    return drive


def _gap(episode: Episode, track: Track, key: Array) -> Command:
    angles = jnp.asarray(beam_angles(), episode.scans.dtype)
    return follow_the_gap(episode.scans[-1], angles, parameters=GAP)


def _follow(episode: Episode, track: Track, key: Array) -> Command:
    return follow(
        _car(episode, 0),
        episode.world.progress[0],
        track,
        behind=-lead_distance(episode.world),
        leader_speed=_car(episode, 1).speed,
    )


def _nothing(episode: Episode, track: Track, key: Array) -> Command:
    return Command(jnp.zeros(()), jnp.zeros(()))


def _saturated(episode: Episode, track: Track, key: Array) -> Command:
    """Full left or full right, full speed or none."""
    left, fast = jax.random.bernoulli(key, shape=(2,)).astype(jnp.float32)
    return Command(2 * left - 1, MAX_SPEED_COMMAND * fast)


DRIVERS: dict[str, dict[str, Driver]] = {
    SAFE: {
        "pursuit": _pursuit(PursuitParameters()),
        "fast pursuit": _pursuit(FAST),
        "lidar only": _gap,
        "nothing": _nothing,
        "saturated": _saturated,
    },
    FOLLOW: {"follower": _follow, "nothing": _nothing, "saturated": _saturated},
}


def played(
    simulation: Simulation, key: Array, driver: Array, *, drivers: list[Driver], steps: int
) -> tuple[dict[str, Array], Array]:
    """Signals of an episode (steps + 1,), and its length; what comes later does not count."""

    def control(carry: tuple[Episode, Array], chance: Array) -> Any:
        episode, ended = carry
        track = selected(simulation.tracks, episode.track)
        commands = [drive(episode, track, chance) for drive in drivers]
        command = jax.tree.map(lambda *values: jnp.stack(values)[driver], *commands)
        now = (episode.commands[-1, 1] + 1) / 2 * MAX_SPEED_COMMAND
        action = jnp.stack([(command.speed - now) / SPEED_CHANGE, command.steering])
        episode, _, signals, _, terminated, truncated = simulation.step(episode, action)
        return (episode, ended | terminated | truncated), (signals, ~ended)

    start, chances = jax.random.split(key)
    episode, _, first = simulation.reset(start)
    carry = (episode, jnp.zeros((), bool))
    _, (signals, counts) = jax.lax.scan(control, carry, jax.random.split(chances, steps))
    trace = jax.tree.map(lambda one, rest: jnp.concatenate([one[None], rest]), first, signals)
    return trace, counts.sum()


def ceilings(traces: dict[str, Array], lengths: Array, lap: float) -> str:
    """What leaders do, and what they leave to any driver on the centre line.

    Too far behind, it drives as fast as the fastest car can be told to, whatever the bend; too
    close, it stands.
    """
    far, close, speeds, starts = [], [], [], []
    low, high = (CONSTANTS[name] for name in ("distance_min", "distance_max"))
    for row, length in enumerate(lengths):
        behind = -traces["lead_distance"][row, : length + 1]
        leader = behind + lap * traces["progress"][row, : length + 1]
        command = np.minimum(MAX_SPEED_COMMAND, SPEED_CHANGE * np.arange(length + 1))
        reached = np.cumsum(OBEYED * command) * CONTROL_STEP
        far.append(np.mean((leader - reached <= -low)[1:]))
        close.append(np.mean((leader >= -high)[1:]))
        speeds.append(np.diff(leader)[UNDER_WAY:] / CONTROL_STEP)
        starts.append(-high <= behind[0] <= -low)
    mean = [each.mean() for each in speeds]
    return (
        f"of which leaders: {min(mean):.1f} to {max(mean):.1f} m/s, at most "
        f"{max(each.max() for each in speeds):.1f} m/s; starts within both limits "
        f"{np.mean(starts):.2f}; not_too_far up to {np.mean(far):.2f}, "
        f"not_too_close up to {np.mean(close):.2f}"
    )


def measure(name: str, tracks: list[str]) -> None:
    """Print the lines of one benchmark."""
    task = task_of(name)
    labels = [r.label for r in task.requirements if r.kind == "encourage"]
    print(f"\n{name}", *["S", "S+T", "S+T+C", "PAM", *labels, "time"], sep=" | ")
    drivers, steps = list(DRIVERS[name].values()), functional.FUNCTIONAL[name].horizon
    made = {
        (track, reverse): functional.make(name, tracks=track, reverse=reverse)
        for track in tracks
        for reverse in (False, True)
    }
    # In one stack all have the same shapes, so that there is one compilation.
    stack = stack_tracks([jax.tree.map(lambda leaf: leaf[0], one.tracks) for one in made.values()])

    @jax.jit
    def play(simulation: Simulation, keys: Array, driver: Array) -> Any:
        def one(key: Array) -> Any:
            return played(simulation, key, driver, drivers=drivers, steps=steps)

        return jax.vmap(one)(keys)

    keys = jax.vmap(jax.random.key)(jnp.arange(STARTS))
    for number, driver in enumerate(DRIVERS[name]):
        for row, (track, reverse) in enumerate(made):
            one = jax.tree.map(lambda leaf, row=row: leaf[row : row + 1], stack)
            simulation = replace(made[track, reverse], tracks=one)
            traces, lengths = jax.tree.map(np.asarray, play(simulation, keys, number))
            episodes = [
                hprs.assess(task, {key: v[i, : length + 1] for key, v in traces.items()})
                for i, length in enumerate(lengths)
            ]
            summary = hprs.summarise(episodes)
            figures = [summary.safe, summary.safe_target, summary.safe_target_comfort, summary.pam]
            figures += [summary.requirements[label] for label in labels]
            print(
                f"{driver}, {track}{' backwards' if reverse else ''}",
                *(f"{figure:.2f}" for figure in figures),
                f"{lengths.mean() / 10:.1f} s",
                sep=" | ",
                flush=True,
            )
            if driver == "follower":
                print(ceilings(traces, lengths, float(one.length[0])), flush=True)


if __name__ == "__main__":
    measure(SAFE, sys.argv[1:] or ["gm", "trt", "gm-c"])
    measure(FOLLOW, sys.argv[1:] or ["gm-c"])
