"""Environment steps a second of SAC, one update each: ours, Stable-Baselines3's, SBX's, and bounds.

    .venv/bin/python benchmarks/sac.py
    .venv/bin/python benchmarks/sac.py --sbx PYTHON    # a Python that has sbx-rl and hprs
    .venv/bin/python benchmarks/sac.py --gpu           # populations in one program, on a GPU

Both cores are everybody's. "Bare" is our update alone, compiled, on one batch for ever; "matrix
products" are those of an update and nothing else. Compilation and evaluations are left out.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

ROUNDS = 2
SECONDS = 8.0
"""Of learning in a measurement."""
WALKER, LANDER, CAR = "hprs/BipedalWalker-v0", "hprs/LunarLanderObstacle-v0", "hprs/SafeDriving-v0"
LAYERS: Mapping[str, list[int]] = {WALKER: [256, 256], LANDER: [400, 300], CAR: [256, 256]}
STARTS = 300
"""Random steps before the first update."""


def configuration_of(environment: str, trainer: str, seed: int = 0, **settings: Any) -> Any:
    """What is trained."""
    from hprs.training.configure import configure

    chosen = {"learning_starts": STARTS, "buffer_size": 100_000, "net_arch": LAYERS[environment]}
    return configure(
        environment,
        algorithm="sac",
        trainer=trainer,
        steps=10**9,
        seed=seed,
        settings={**chosen, **settings},
    )


def timed(advance: Callable[[], int]) -> float:
    """Steps a second of something that returns how many it has made in all."""
    before, start = advance(), time.perf_counter()
    made = before
    while time.perf_counter() < start + SECONDS:
        made = advance()
    return (made - before) / (time.perf_counter() - start)


def ours(environment: str, members: int = 1, **settings: Any) -> dict[str, float]:
    """The JAX trainer."""
    import jax

    from hprs.training.sac.training import open_session

    start = time.perf_counter()
    seeds = range(members)
    session: Any = open_session(
        [configuration_of(environment, "jax", seed, **settings) for seed in seeds]
    )

    def advance() -> int:
        session.advance(session.step + 1_000)
        jax.block_until_ready(session.learned(0))
        return session.step

    while session.step < 2 * STARTS:
        advance()
    first = time.perf_counter() - start
    return {"rate": members * timed(advance), "first": first}


def bare(environment: str) -> dict[str, float]:
    """Our update alone."""
    import jax
    import jax.numpy as jnp

    from hprs.training.sac.learner import Batch
    from hprs.training.sac.training import open_session

    session: Any = open_session([configuration_of(environment, "jax")])
    shape = session.shape
    rows = shape.settings.batch_size
    seen = jax.random.normal(jax.random.key(0), (rows, shape.observation))
    no = jnp.zeros(rows, bool)
    action = jnp.zeros((rows, shape.actions.outputs))
    batch = Batch(seen, action, jnp.ones(rows), no, no, ~no, seen)
    noise = jax.random.normal(jax.random.key(1), (2, rows, shape.actions.outputs))
    parameters = session._configuration.parameters
    weights = shape.weights(parameters, 10**9)
    update = jax.jit(shape.update, donate_argnums=0)
    member, made = shape.make(0, parameters), 0

    def advance() -> int:
        nonlocal member, made
        for _ in range(20):
            member, _ = update(member, batch, noise, weights, 0.0)
        jax.block_until_ready(member)
        made += 20
        return made

    return {"rate": timed(advance)}


def products(environment: str) -> dict[str, float]:
    """The matrix products of an update in NumPy, and nothing else."""
    import numpy as np

    from hprs.training.environment import make_configured

    made = make_configured(configuration_of(environment, "jax"))
    seen, outputs = made.observation_space.shape[0], made.action_space.shape[0]
    made.close()
    hidden, rows = LAYERS[environment], 256

    def passes(sizes: list[int]) -> list[tuple[np.ndarray, np.ndarray]]:
        return [
            (np.ones((rows, a), np.float32), np.ones((a, b), np.float32))
            for a, b in pairwise(sizes)
        ]

    policy = passes([seen, *hidden, 2 * outputs])
    critic = passes([seen + outputs, *hidden, 1])
    # Forward and twice backward: the policy once, and forward once more for the targets; each
    # critic once, forward for the targets, and forward and once backward for the policy.
    work = policy * 4 + critic * 2 * 6

    def advance() -> int:
        nonlocal done
        for inputs, weights in work:
            inputs @ weights
        done += 1
        return done

    done = 0
    return {"rate": timed(advance)}


def theirs(environment: str, *, sbx: bool = False) -> dict[str, float]:
    """Stable-Baselines3 or SBX, on an environment with the same task."""
    import torch
    from stable_baselines3.common.callbacks import BaseCallback

    if sbx:
        from sbx import SAC
    else:
        from stable_baselines3 import SAC
    from hprs.training.environment import make_configured

    torch.set_num_threads(len(os.sched_getaffinity(0)))

    class Clock(BaseCallback):
        """Stops after the time, which begins when learning has."""

        def __init__(self) -> None:
            super().__init__()
            self.mark: tuple[int, float] | None = None
            self.rate = 0.0

        def _on_step(self) -> bool:
            now = time.perf_counter()
            if self.num_timesteps == 2 * STARTS:
                self.mark = self.num_timesteps, now
            if self.mark is None or now < self.mark[1] + SECONDS:
                return True
            self.rate = (self.num_timesteps - self.mark[0]) / (now - self.mark[1])
            return False

    clock = Clock()
    made = make_configured(configuration_of(environment, "jax"))
    SAC(
        "MlpPolicy",
        made,
        learning_starts=STARTS,
        buffer_size=100_000,
        policy_kwargs={"net_arch": LAYERS[environment]},
        device="cpu",
    ).learn(10**9, clock)
    return {"rate": clock.rate}


WORK: Mapping[str, Callable[[str], dict[str, float]]] = {
    "matrix products": products,
    "bare": bare,
    "ours": ours,
    "ours, no overlap": lambda name: ours(name, overlap=False),
    "sb3": theirs,
    "sbx": lambda name: theirs(name, sbx=True),
    "ours, 4 members": lambda name: ours(name, 4),
}


def measure(what: str, name: str, python: str = sys.executable) -> dict[str, float]:
    """A measurement in a process of its own, on all cores."""
    call = [python, __file__, "--measure", what, name]
    done = subprocess.run(call, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def measure_all(python: str | None) -> None:
    """Print the table."""
    rows = [
        (what, name)
        for name in (WALKER, LANDER)
        for what in ("matrix products", "bare", "ours", "ours, no overlap", "sb3", "sbx")
        if what != "sbx" or python is not None
    ]
    rows += [(what, CAR) for what in ("bare", "ours", "ours, 4 members", "sb3")]
    for what, name in rows:
        program = python if what == "sbx" and python is not None else sys.executable
        found = [measure(what, name, program) for _ in range(ROUNDS)]
        best = max(found, key=lambda one: one["rate"])
        note = ", ".join(f"{key} {value:.1f} s" for key, value in best.items() if key != "rate")
        print(f"{name:30s} {what:20s} {best['rate']:8.1f} steps/s  {note}", flush=True)


def populations() -> None:
    """Print the rates of populations that are one program."""
    for members in (1, 10, 60, 120):
        found = ours(CAR, members, buffer_size=300_000)
        joint = found["rate"] / members
        print(
            f"{members:4d} members {joint:10.1f} joint steps/s, {found['rate']:12,.0f} in all, "
            f"begun in {found['first']:.0f} s",
            flush=True,
        )


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["--measure", what, name]:
            print(json.dumps(WORK[what](name)))
        case ["--sbx", python]:
            measure_all(python)
        case ["--gpu"]:
            SECONDS = 60.0
            populations()
        case _:
            measure_all(None)
