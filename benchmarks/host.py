"""What stepping 32 environments for a learner costs beside the environments themselves.

    .venv/bin/python benchmarks/host.py

Landers with a task of five requirements play the same random actions bare, wrapped, and on the
host, in turns; the ratios are to the bare step of the same run.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import time
from collections.abc import Callable, Sequence

import gymnasium as gym
import numpy as np
from _common import lander, lander_task

import hprs
from hprs.envs.registration import BENCHMARKS
from hprs.training.host import SingleEnvironments, VectorEnvironments
from hprs.training.host.interface import HostEnvironments
from hprs.training.random_states import derive_seed

NUMBER, STEPS, ROUNDS = 32, 200, 25
GENERATOR = np.random.default_rng(0)
ACTIONS = GENERATOR.uniform(-1, 1, (STEPS, NUMBER, 2)).astype(np.float32)
CHOICES = GENERATOR.integers(0, 2, (STEPS, NUMBER))


def loop(environments: Sequence[gym.Env]) -> float:
    """Seconds of processor time an environment-step of a bare loop, resets included."""
    for row, environment in enumerate(environments):
        # As the host does: the same episodes.
        environment.reset(seed=derive_seed(0, 0, row))
    start = time.process_time()
    for actions in ACTIONS:
        for environment, action in zip(environments, actions, strict=True):
            _, _, terminated, truncated, _ = environment.step(action)
            if terminated or truncated:
                environment.reset()
    return (time.process_time() - start) / ACTIONS[..., 0].size


def host(environments: HostEnvironments, actions: np.ndarray) -> float:
    """Seconds of processor time an environment-step."""
    environments.reset(0)
    start = time.process_time()
    for action in actions:
        environments.step(action)
    return (time.process_time() - start) / (len(actions) * NUMBER)


def in_turns(*measured: Callable[[], float]) -> list[float]:
    """The smallest time of the first, and medians of what each adds to the one before it."""
    rounds = np.array([[measure() for measure in measured] for _ in range(ROUNDS)])
    return [rounds[:, 0].min(), *np.median(np.diff(rounds), axis=0)]


def landers() -> float:
    """Prints what is added to bare landers; returns their step."""
    task = lander_task()
    bare = [lander() for _ in range(NUMBER)]
    # Episodes that the task does not end: resets would differ.
    wrapped = [hprs.wrap(lander(), task, end_on_violation=False) for _ in range(NUMBER)]
    stepped = SingleEnvironments(
        [hprs.wrap(lander(), task, end_on_violation=False) for _ in range(NUMBER)]
    )
    alone, tasked, hosted = in_turns(
        lambda: loop(bare), lambda: loop(wrapped), lambda: host(stepped, ACTIONS)
    )
    print(f"bare LunarLander step       {alone * 1e6:6.2f} us  (the yardstick)")
    for name, added in (("hprs.wrap adds", tasked), ("the host adds", hosted)):
        print(f"{name:<26}  {added * 1e6:6.2f} us  = {added / alone:.3f} yardsticks")
    return alone


class Still(gym.Env):
    """Does nothing: all the cost is around it."""

    observation_space = gym.spaces.Box(-1.0, 1.0, (8,))
    action_space = gym.spaces.Box(-1.0, 1.0, (2,))

    def __init__(self) -> None:
        self.seen = np.zeros(8, np.float32)

    def reset(self, *, seed=None, options=None):
        """The same numbers."""
        super().reset(seed=seed)
        return self.seen, {}

    def step(self, action):
        """The same numbers."""
        return self.seen, 0.0, False, False, {}


def still(yardstick: float) -> None:
    """Prints what is added where no physics evicts the code from the processor's caches."""
    task = lander_task()
    wrapped = [hprs.wrap(Still(), task) for _ in range(NUMBER)]
    stepped = SingleEnvironments([hprs.wrap(Still(), task) for _ in range(NUMBER)])
    _, added = in_turns(lambda: loop(wrapped), lambda: host(stepped, ACTIONS))
    print(
        f"without any physics         {added * 1e6:6.2f} us  = {added / yardstick:.3f} yardsticks"
    )


def cart_poles(yardstick: float) -> None:
    """Prints a step of the native vector environment, and one of single ones."""
    name = "hprs/CartPole-v0"
    task = BENCHMARKS[name].task
    vector = VectorEnvironments(hprs.wrap_vector(gym.make_vec(name, NUMBER), task))
    single = SingleEnvironments([hprs.wrap(gym.make(name), task) for _ in range(NUMBER)])
    for kind, environments in (("native vector", vector), ("one by one", single)):
        (each,) = in_turns(lambda made=environments: host(made, CHOICES))
        ratio = each / yardstick
        print(
            f"cart pole, {kind:<15}  {each * 1e6:6.2f} us  = {ratio:.3f} yardsticks, all included"
        )


if __name__ == "__main__":
    print(f"{NUMBER} environments; an environment-step")
    yardstick = landers()
    still(yardstick)
    cart_poles(yardstick)
