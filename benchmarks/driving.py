"""Control steps of the driving benchmark a second, over the steps of Gymnasium's lander.

    .venv/bin/python benchmarks/driving.py

A control step is 10 simulation steps with tests for contact, a lidar scan, the task's signals, and
its score and reward. The yardstick, a step of the bare continuous lander on one core, is measured
in turns with it. A batch takes all cores that XLA finds work for.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace

import gymnasium as gym
import jax
import jax.numpy as jnp
import numpy as np
from _common import lander, lander_step
from _flower import flower
from jax.sharding import NamedSharding, PartitionSpec

import hprs
from hprs.carsim.designs import load_track
from hprs.carsim.track import stack_tracks
from hprs.envs import task_of
from hprs.envs.functional import Simulation, make

ENVIRONMENT = "hprs/SafeDriving-v0"
TASK = task_of(ENVIRONMENT)
CARS = (1, 16, 256, 1_024, 4_096, 16_384)
ROUNDS = 15
AHEAD = np.array([0.3, 0.0], np.float32)


def in_turns(step: Callable[[], int], budget: float = 0.05) -> tuple[float, float]:
    """Control steps a second, and the same over lander steps a second: the best of all rounds.

    Args:
        step: Makes some control steps and returns their number.
        budget: Seconds of a round.
    """
    env = lander()
    step()
    best, yardstick = 0.0, 0.0
    for _ in range(ROUNDS):
        yardstick = max(yardstick, 1 / lander_step(env, 1_000))
        made, start = 0, time.perf_counter()
        while time.perf_counter() < start + budget:
            made += step()
        best = max(best, made / (time.perf_counter() - start))
    return best, best / yardstick


def show(label: str, rate: float, ratio: float) -> None:
    """Print a line."""
    print(f"{label:60s} {rate:10,.0f} control steps/s {ratio:8.3g} yardsticks", flush=True)


def one_environment() -> Callable[[], int]:
    """A wrapped environment with random actions, as the yardstick's are; resets included."""
    env = hprs.wrap(gym.make(ENVIRONMENT, disable_env_checker=True), TASK, reward="hprs")
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(1_000)]

    def step() -> int:
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return len(actions)

    return step


def vector_environment(number: int) -> Callable[[], int]:
    """A wrapped vector environment, resets included."""
    envs = hprs.wrap_vector(gym.make_vec(ENVIRONMENT, number), TASK, reward="hprs")
    envs.reset(seed=0)
    actions = np.tile(AHEAD, (number, 1))

    def step() -> int:
        envs.step(actions)
        return number

    return step


def jitted(simulation: Simulation, number: int) -> Callable[[], int]:
    """A compiled call of so many episodes with their rewards; it resets none.

    Every device of JAX takes its share of them; on a CPU there may be one to each core.
    """
    reward = hprs.make_reward("hprs", TASK)
    mesh = jax.make_mesh((len(jax.devices()),), ("cars",))
    shared, split = PartitionSpec(), PartitionSpec("cars")

    @jax.jit
    def start(keys: jax.Array) -> tuple:
        episodes, _, signals = jax.vmap(simulation.reset)(keys)
        return episodes, reward.init({**signals, "env_reward": jnp.zeros(len(keys))})

    def advance(simulation: Simulation, state: tuple, actions: jax.Array) -> tuple:
        episodes, memory = state
        step = jax.vmap(lambda episode, action: simulation.step(episode, action))
        episodes, observed, signals, env_reward, terminated, truncated = step(episodes, actions)
        memory, paid = reward.step(
            memory, {**signals, "env_reward": env_reward}, terminated, truncated
        )
        return (episodes, memory), (observed, paid, terminated, truncated)

    shards = jax.shard_map(
        advance, mesh=mesh, in_specs=(shared, split, split), out_specs=split, check_vma=False
    )
    compiled = jax.jit(shards, donate_argnums=1)
    state = start(jax.random.split(jax.random.key(0), number))
    state = jax.device_put(state, NamedSharding(mesh, split))
    simulation = jax.device_put(simulation, NamedSharding(mesh, shared))
    actions = jax.device_put(np.tile(AHEAD, (number, 1)), NamedSharding(mesh, split))

    def step() -> int:
        nonlocal state
        state, results = compiled(simulation, state, actions)
        jax.block_until_ready(results)
        return number

    return step


def all_sizes(label: str, simulation: Simulation, cars: tuple[int, ...] = CARS) -> None:
    """Print a line for each number of cars."""
    for number in cars:
        show(f"{label}, {number:,d} in one jitted call", *in_turns(jitted(simulation, number)))


def again(part: str, **settings: str) -> None:
    """Run a part of this script in a process with other settings of JAX."""
    arguments = [sys.executable, __file__, part]
    subprocess.run(arguments, env={**os.environ, **settings}, check=True)


def measure_all() -> None:
    """Print everything, each line in a process of its own where JAX's settings differ."""
    show("one, Gymnasium and hprs.wrap", *in_turns(one_environment()))
    again("one", JAX_CPU_ENABLE_ASYNC_DISPATCH="false")
    show("1,024 in a vector environment, hprs.wrap_vector", *in_turns(vector_environment(1_024)))
    simulation = make(ENVIRONMENT)
    all_sizes("gm and trt", simulation)
    again("devices", JAX_NUM_CPU_DEVICES=str(os.cpu_count()))
    all_sizes("gm and trt, 1,080 beams", make(ENVIRONMENT, beams=1_080), (1, 64, 1_024))
    for name, track in (("gm-c", load_track("gm-c")), ("flower of 30 m", flower(30))):
        all_sizes(name, replace(simulation, tracks=stack_tracks([track])), (1_024,))


match sys.argv[1:]:
    case ["one"]:
        show("the same, JAX_CPU_ENABLE_ASYNC_DISPATCH=false", *in_turns(one_environment()))
    case ["devices"]:
        all_sizes("a device to each core", make(ENVIRONMENT), CARS[2:])
    case _:
        measure_all()
