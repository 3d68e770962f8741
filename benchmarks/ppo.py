"""Control steps a second of PPO, updates included: ours, Stable-Baselines3's, and SBX's.

    .venv/bin/python benchmarks/ppo.py
    .venv/bin/python benchmarks/ppo.py --sbx PYTHON    # a Python that has sbx-rl and hprs
    .venv/bin/python benchmarks/ppo.py --parts         # only where the time goes
    .venv/bin/python benchmarks/ppo.py --gpu           # populations in one program, on a GPU

Rates are of steady learning: compilation and evaluations are left out, and shown beside it. Every
learner has a process and a core of its own; a population of 10 is two such processes at once, as
`hprs train --seeds 10` runs them. The yardstick, a bare lander's step on one core, is measured in
turns with them.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

CORES = sorted(os.sched_getaffinity(0))[:2]
ROUNDS = 2
SECONDS = 6.0
"""Of learning in a measurement."""
A_CALL = 20_000
"""Environment steps that are learned from in a call, where a call can hold several updates."""
ONE_CORE = {
    "OMP_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
}
CAR, LANDER, WALKER = "hprs/SafeDriving-v0", "hprs/LunarLanderObstacle-v0", "hprs/BipedalWalker-v0"
SIZES: Mapping[str, Mapping[str, Any]] = {
    "car": {"environments": 64, "n_steps": 32, "batch_size": 256, "n_epochs": 4},
    "1,024 cars": {"environments": 1024, "n_steps": 32, "batch_size": 4096, "n_epochs": 4},
    "4,096 cars": {"environments": 4096, "n_steps": 32, "batch_size": 16384, "n_epochs": 4},
    "lander": {"environments": 32, "n_steps": 512, "batch_size": 512, "n_epochs": 10},
    "lander, 16 x 1,024": {
        "environments": 16,
        "n_steps": 1024,
        "batch_size": 64,
        "n_epochs": 4,
    },
    "walker": {"environments": 32, "n_steps": 512, "batch_size": 512, "n_epochs": 10},
}
"""Name to the sizes of a training."""


def environment_of(name: str) -> str:
    """The id of the environment that a measurement is of."""
    return CAR if "car" in name else WALKER if "walker" in name else LANDER


def configuration_of(name: str, trainer: str, seed: int = 0) -> Any:
    """What is trained."""
    from hprs.envs import task_text_of
    from hprs.training.configuration import Configuration
    from hprs.training.ppo.settings import Settings

    environment = environment_of(name)
    return Configuration(
        environment=environment,
        task_text=task_text_of(environment) or "",
        algorithm="ppo",
        trainer=trainer,
        parameters=asdict(Settings(**SIZES[name])),
        steps=10**9,
        seed=seed,
    )


def timed(advance: Callable[[], int]) -> float:
    """Steps a second of something that returns how many it has made in all."""
    before, start = advance(), time.perf_counter()
    made = before
    while time.perf_counter() < start + SECONDS:
        made = advance()
    return (made - before) / (time.perf_counter() - start)


def ours(name: str) -> dict[str, float]:
    """The JAX trainer."""
    from hprs.training.ppo.training import open_session

    start = time.perf_counter()
    session = open_session([configuration_of(name, "jax")])

    def advance() -> int:
        session.advance(session.step + A_CALL)
        return session.step

    advance()
    first = time.perf_counter() - start
    start = time.perf_counter()
    session.evaluate(range(10), lambda done: None)
    compiling = time.perf_counter() - start
    start = time.perf_counter()
    session.evaluate(range(10), lambda done: None)
    evaluation = time.perf_counter() - start
    rate = timed(advance)
    return {"rate": rate, "first": first, "trace": compiling, "evaluation": evaluation}


def parts(name: str) -> dict[str, float]:
    """Microseconds of each environment step that goes where, and of it in all."""
    import jax

    from hprs.training.ppo.on_device import DeviceSession
    from hprs.training.ppo.training import open_session

    session: Any = open_session([configuration_of(name, "jax")])
    rollout = session.shape.settings.rollout
    if isinstance(session, DeviceSession):
        spent = {**_device_parts(session, jax), "all": rollout / ours(name)["rate"]}
    else:
        spent = _host_parts(session, jax)
    return {key: 1e6 * seconds / rollout for key, seconds in spent.items()}


def _device_parts(session: Any, jax: Any) -> dict[str, float]:
    """Seconds of a rollout, of acting in it, and of an update, each compiled alone."""
    from functools import partial

    from _common import seconds

    from hprs.training.ppo import on_device
    from hprs.training.trees import one_of

    shape, environment, simulation = session.shape, session._environment, session._simulation
    session.advance(session.step + 1)
    state = one_of(session._states, 0)
    weights = one_of(session._weights, 0)
    roll_out = jax.jit(partial(on_device.roll_out, shape, environment))
    _, rollout = roll_out(simulation, state)
    update = jax.jit(shape.update)
    # Other observations at every step: of equal ones XLA would compute the network once.
    noise = jax.numpy.zeros_like(rollout.action)
    act = jax.jit(
        lambda member, seen, noise: jax.lax.map(lambda one: shape.act(member, *one), (seen, noise))
    )
    wait = jax.block_until_ready
    acting = seconds(lambda: wait(act(state.member, rollout.observation, noise)), 5)
    return {
        "environment": seconds(lambda: wait(roll_out(simulation, state)), 5) - acting,
        "acting": acting,
        "update": seconds(lambda: wait(update(state.member, rollout, weights, 0)), 5),
    }


def _host_parts(session: Any, jax: Any) -> dict[str, float]:
    """Seconds of a rollout's parts, timed where they are called, and of all of it."""
    spent = dict.fromkeys(("environment", "acting", "update"), 0.0)
    times = 3

    def timed_call(part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            start = time.perf_counter()
            result = jax.block_until_ready(function(*arguments))
            spent[part] += time.perf_counter() - start
            return result

        return call

    session.advance(1)
    session._act = timed_call("acting", session._act)
    session._update = timed_call("update", session._update)
    environments = session._environments
    environments.step = timed_call("environment", environments.step)
    start = time.perf_counter()
    for _ in range(times):
        session.advance(10**9)
    spent["all"] = time.perf_counter() - start
    return {key: seconds / times for key, seconds in spent.items()}


def populations() -> None:
    """Print the rates of populations that are one program, 4,096 cars a member."""
    from hprs.training.ppo.training import open_session

    for members in (1, 10, 60):
        start = time.perf_counter()
        session = open_session(
            [configuration_of("4,096 cars", "jax", seed=i) for i in range(members)]
        )

        def advance(session: Any = session) -> int:
            session.advance(session.step + 1)
            return session.step

        advance()
        first = time.perf_counter() - start
        rate = members * timed(advance)
        print(
            f"{members:3d} members {rate:14,.0f} steps/s in all, begun in {first:.0f} s", flush=True
        )


def theirs(name: str, *, sbx: bool = False, vector: bool = False) -> dict[str, float]:
    """Stable-Baselines3 or SBX with the same sizes, on environments with the same task."""
    import torch
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    if sbx:
        from sbx import PPO
    else:
        from stable_baselines3 import PPO
    from hprs.training.environment import make_configured

    torch.set_num_threads(1)
    configuration = configuration_of(name, "sb3")
    number = SIZES[name]["environments"]
    if vector:
        from _sb3_vector import NativeVector

        environments: Any = NativeVector(configuration, number)
    else:
        environments = DummyVecEnv([lambda: make_configured(configuration)] * number)
    environments = VecNormalize(environments)
    sizes = {key: SIZES[name][key] for key in ("n_steps", "batch_size", "n_epochs")}

    class Clock(BaseCallback):
        """Stops after the time, from the second rollout on."""

        def __init__(self) -> None:
            super().__init__()
            self.marks: list[tuple[int, float]] = []

        def _on_rollout_start(self) -> None:
            self.marks.append((self.num_timesteps, time.perf_counter()))

        def _on_step(self) -> bool:
            return len(self.marks) < 3 or self.marks[-1][1] < self.marks[1][1] + SECONDS

    clock = Clock()
    PPO("MlpPolicy", environments, device="cpu", **sizes).learn(10**9, clock)
    (before, start), (after, end) = clock.marks[1], clock.marks[-1]
    return {"rate": (after - before) / (end - start)}


WORK: Mapping[str, Callable[[str], dict[str, float]]] = {
    "ours": ours,
    "parts": parts,
    "sb3": theirs,
    "sb3-vector": lambda name: theirs(name, vector=True),
    "sbx": lambda name: theirs(name, sbx=True),
}


def begin(what: str, name: str, core: int, python: str = sys.executable) -> subprocess.Popen[str]:
    """Start a measurement in a process of its own, on one core."""
    call = ["taskset", "-c", str(core), python, __file__, "--measure", what, name]
    return subprocess.Popen(call, stdout=subprocess.PIPE, text=True, env={**os.environ, **ONE_CORE})


def end(process: subprocess.Popen[str]) -> dict[str, float]:
    """What a measurement found."""
    out, _ = process.communicate()
    if process.returncode:
        raise SystemExit(f"{process.args} failed")
    return json.loads(out.splitlines()[-1])


def yardstick() -> float:
    """Steps a second of the bare lander."""
    from _common import lander, lander_step

    return 1 / min(lander_step(lander(), 5_000) for _ in range(3))


def show(label: str, rates: list[float], yardsticks: list[float], note: str = "") -> None:
    """Print a line: the best of all rounds, over the best of all yardsticks."""
    rate, bare = max(rates), max(yardsticks)
    print(f"{label:44s} {rate:10,.0f} steps/s {rate / bare:8.3g} yardsticks  {note}", flush=True)


def measure_all(python: str | None) -> None:
    """Print the table."""
    rows = [("ours", name) for name in SIZES if name != "4,096 cars"]
    rows += [
        ("sb3", "lander, 16 x 1,024"),
        ("sb3", "walker"),
        ("sb3", "car"),
        ("sb3-vector", "car"),
    ]
    if python is not None:
        rows += [("sbx", "lander, 16 x 1,024"), ("sbx", "walker"), ("sbx", "car")]
    for what, name in rows:
        rates: list[float] = []
        bare: list[float] = []
        found: dict[str, float] = {}
        for _ in range(ROUNDS):
            bare.append(yardstick())
            program = python if what == "sbx" and python is not None else sys.executable
            found = end(begin(what, name, CORES[0], program))
            rates.append(found["rate"])
        note = ", ".join(f"{key} {value:.2f} s" for key, value in found.items() if key != "rate")
        show(f"{what}, {name}, one core", rates, bare, note)
    for name in ("car", "1,024 cars", "lander", "walker"):
        rates, bare = [], []
        for _ in range(ROUNDS):
            bare.append(yardstick())
            members = [begin("ours", name, core) for core in CORES]
            rates.append(sum(end(member)["rate"] for member in members))
        show(f"ours, {name}, {len(CORES)} members at once", rates, bare)


def print_parts() -> None:
    """Print where the time of a step goes."""
    for name in ("car", "1,024 cars", "lander", "walker"):
        found = end(begin("parts", name, CORES[0]))
        shown = ", ".join(f"{key} {value:.2f}" for key, value in found.items())
        print(f"{name:44s} us an environment step: {shown}", flush=True)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["--measure", what, name]:
            print(json.dumps(WORK[what](name)))
        case ["--sbx", python]:
            measure_all(python)
            print_parts()
        case ["--parts"]:
            print_parts()
        case ["--gpu"]:
            populations()
        case _:
            measure_all(None)
            print_parts()
