"""What each reward costs: one environment, a batch of 4,096, and BHNR by the length of its window.

    .venv/bin/python benchmarks/rewards.py

Everything is a ratio to a bare LunarLander-v3 step, measured in the same run. Of one environment
two numbers are shown: what the reward's own functions take on a task's signals, and what
`hprs.wrap` with the reward adds to the lander's step, which is what a learner notices.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from _common import driving_task, lander, lander_step, lander_task, seconds

import hprs
from hprs.rewards import REWARDS, Reward
from hprs.semantics.evaluation import carry, evaluate
from hprs.spec.task import Task

BATCH, STEPS, ROUNDS = 4_096, 64, 8
WINDOWS = (1, 5, 15, 30, 60, 150)
ENDING = 0.01
"""Share of a batch's episodes that end in a step."""


def reward_of(name: str, task: Task, **options: object) -> Reward:
    """A reward with the lander's or the driving tasks' usual window, and weights of one."""
    if name == "morl":
        options = {"weights": [1.0] * len(task.requirements)}
    return hprs.make_reward(name, task, discount=0.99, horizon=300, **options)


def states(task: Task, shape: tuple[int, ...]) -> list[dict]:
    """Signals of some states, inside their ranges, already evaluated as in the wrappers."""
    rng = np.random.default_rng(0)
    found = []
    for _ in range(STEPS):
        values = {name: rng.uniform(b.low, b.high, shape) for name, b in task.ranges.items()}
        values["env_reward"] = np.zeros(shape)
        found.append(values if shape else {k: float(v) for k, v in values.items()})
    return evaluated(task, found)


def evaluated(task: Task, signals: list[dict]) -> list[dict]:
    """The same signals, evaluated for a task."""
    found = []
    for values in signals:
        own = {k: v for k, v in values.items() if isinstance(v, np.ndarray | float)}
        carry(own, task, evaluate(task, own))
        found.append(own)
    return found


def step_seconds(reward: Reward, signals: list[dict], terminated: object) -> float:
    """Seconds a step of a reward's own functions, the evaluation of the task left out."""

    def run() -> None:
        memory = reward.init(signals[0])
        for values in signals:
            memory, _ = reward.step(memory, values, terminated, False & terminated)

    return seconds(run) / len(signals)


def single() -> float:
    """Each reward in one lander; the yardstick is returned."""
    task = lander_task()
    signals = states(task, ())
    scalar = [name for name in REWARDS if name != "vector"]
    wrapped: dict[str, list[float]] = {name: [] for name in scalar}
    bare: list[float] = []
    # In turns, so that other work on the machine disturbs all alike.
    for _ in range(ROUNDS):
        bare.append(lander_step(lander(), 3_000))
        for name in scalar:
            env = hprs.wrap(lander(), task, reward_of(name, task), end_on_violation=False)
            wrapped[name].append(lander_step(env, 3_000))
    yardstick = min(bare)
    print(f"bare LunarLander step {yardstick * 1e6:8.2f} us  (the yardstick)\n")
    print("one lander, five requirements")
    print(f"{'reward':>16} {'itself':>10} {'':>12} {'with hprs.wrap adds':>20}")
    for name in REWARDS:
        alone = step_seconds(reward_of(name, task), signals, False)
        line = f"{name:>16} {alone * 1e6:7.2f} us {alone / yardstick:6.3f} yard"
        if name in wrapped:
            added = min(wrapped[name]) - yardstick
            line += f" {added * 1e6:11.2f} us {added / yardstick:6.3f} yard"
        print(line)
    return yardstick


def batch(yardstick: float) -> None:
    """Each reward over a batch, its evaluation of the task included."""
    task = driving_task()
    signals = states(task, (BATCH,))
    some = np.random.default_rng(1).random(BATCH) < ENDING
    bare = [{k: v for k, v in values.items() if isinstance(v, np.ndarray)} for values in signals]
    print(f"\nNumPy, {BATCH} environments, seven requirements, ns an environment-step")
    print(f"{'reward':>16} {'itself':>10} {'':>14} {'with evaluation':>16}")
    for name in REWARDS:
        reward = reward_of(name, task)
        alone = step_seconds(reward, signals, some) / BATCH
        whole = step_seconds(reward, bare, some) / BATCH
        print(
            f"{name:>16} {alone * 1e9:10.1f}  1/{yardstick / alone:<8.0f} yard"
            f" {whole * 1e9:10.1f}  1/{yardstick / whole:<6.0f} yard"
        )
    windows(yardstick, signals, some, task)


def windows(yardstick: float, signals: list[dict], some: object, task: Task) -> None:
    """BHNR by the length H of its window: a batch costs O(H), a single environment does not."""
    conquer = hprs.parse_task(hprs.format_task(task).replace("achieve", "conquer"))
    one = states(conquer, ()) * 16
    print(f"\nBHNR by its window H: ns an environment-step of {BATCH}, us of one environment")
    print(f"{'H':>6} {'achieve':>10} {'conquer':>10} {'boolean':>10} {'':>10} {'one, conquer':>14}")
    for size in WINDOWS:
        kinds: list[tuple[Task, str]] = [
            (task, "quantitative"),
            (conquer, "quantitative"),
            (conquer, "boolean"),
        ]
        costs = []
        for chosen, form in kinds:
            reward = reward_of("bhnr", chosen, window=size, form=form)
            values = evaluated(chosen, signals)
            costs.append(step_seconds(reward, values, some) / BATCH)
        reward = reward_of("bhnr", conquer, window=size)
        single = step_seconds(reward, one, False)
        shown = " ".join(f"{cost * 1e9:10.1f}" for cost in costs)
        print(f"{size:>6} {shown}  1/{yardstick / costs[1]:<7.0f} {single * 1e6:13.2f}")


if __name__ == "__main__":
    batch(single())
