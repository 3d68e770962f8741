"""Kills trainings with SIGKILL, resumes them, and compares them with one that was left alone.

Run as a program: `killing.py FOLDER random KIND KILLS SEED` kills after random times,
`killing.py FOLDER each KIND STRIDE` at every STRIDE-th call that changes the disk. Trainings run in
forks of this process, which has imported everything: a kill then hits the training, not the imports.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path

import torch

from hprs.training import sb3
from hprs.training.configuration import Configuration
from hprs.training.run_directory import RunDirectory, create_runs
from tests.training.small import configure_sb3, off_policy, ppo, same_numbers, table

KINDS: dict[str, Callable[[Path], Configuration]] = {
    "ppo": lambda folder: ppo(steps=288),
    "sac": lambda folder: off_policy(folder, settings={"buffer_size": 80}, steps=120),
    "long ppo": lambda folder: ppo(
        "hprs/LunarLanderObstacle-v0",
        {"environments": 4, "n_steps": 128, "net_arch": [32]},
        steps=6000,
        evaluation_interval=500,
        evaluation_episodes=4,
    ),
    "long sac": lambda folder: configure_sb3(
        "hprs/BipedalWalker-v0",
        algorithm="sac",
        settings={"environments": 2, "learning_starts": 100, "buffer_size": 1000, "batch_size": 32,
                  "net_arch": [32]},
        horizon=100,
        steps=1500,
        evaluation_interval=100,
        evaluation_episodes=1,
    ),
}  # fmt: skip


def fork(work: Callable[[], object]) -> int:
    """Start work in a child; its number."""
    child = os.fork()
    if child:
        return child
    status = 1
    try:
        work()
        status = 0
    finally:
        if status:
            traceback.print_exc()
        os._exit(status)


def finish(run: RunDirectory) -> None:
    """Train to the end in a child."""
    _, status = os.waitpid(fork(lambda: sb3.train(run)), 0)
    if status:
        raise SystemExit(f"a training failed: {run.path}")


def recorded(run: RunDirectory) -> str:
    """The table without half a row."""
    text = table(run)
    return text[: text.rfind("\n") + 1]


def compare(whole: RunDirectory, pieces: RunDirectory) -> None:
    """See that nothing differs."""
    if not same_numbers(whole, pieces):
        raise SystemExit(f"the numbers differ: {whole.path} and {pieces.path}")


def at_random(folder: Path, configuration: Configuration, kills: int, seed: int) -> None:
    """Kill after random times; start over where a training has come to its end."""
    chance = random.Random(seed)
    [whole] = create_runs([configuration], folder / "whole")
    started = time.monotonic()
    finish(whole)
    lasts = time.monotonic() - started
    done, attempt = 0, 0
    while done < kills:
        attempt += 1
        [run] = create_runs([configuration], folder / f"killed-{attempt}")
        while done < kills:
            child = fork(lambda run=run: sb3.train(run))
            time.sleep(chance.uniform(0.02, 0.3) * lasts)
            os.kill(child, signal.SIGKILL)
            before = recorded(run)
            if os.waitpid(child, 0)[1] != signal.SIGKILL:
                break
            done += 1
            check = RunDirectory(run.path)
            check.open()
            if not recorded(run).startswith(before):
                raise SystemExit(f"a recorded evaluation is lost: {run.path}")
        finish(run)
        compare(whole, run)
    print(f"{done} kills in {attempt} trainings, each equal to one of {lasts:.1f} s left alone")


def at_each_change(folder: Path, configuration: Configuration, stride: int) -> None:
    """Kill at calls that change the disk, one training a call."""
    [whole] = create_runs([configuration], folder / "whole")
    finish(whole)
    number = stride // 2
    while True:
        [run] = create_runs([configuration], folder / f"killed-{number}")
        child = fork(lambda run=run, number=number: (die_at(number), sb3.train(run)))
        status = os.waitpid(child, 0)[1]
        if not status:
            break
        if status != signal.SIGKILL:
            raise SystemExit(f"a training failed: {run.path}")
        before = recorded(run)
        finish(run)
        compare(whole, run)
        if not table(run).startswith(before):
            raise SystemExit(f"a recorded evaluation is lost: {run.path}")
        number += stride
    print(f"killed at every {stride}. of {number} changes of the disk, each time without loss")


def die_at(number: int) -> None:
    """Kill this process at a call that changes the disk; at a write, when half is written."""
    calls = 0

    def count() -> bool:
        nonlocal calls
        calls += 1
        return calls > number

    def dying(function: Callable[..., object]) -> Callable[..., object]:
        def call(*arguments: object, **options: object) -> object:
            if count():
                os.kill(os.getpid(), signal.SIGKILL)
            return function(*arguments, **options)

        return call

    def half(path: Path, content: bytes) -> None:
        if count():
            path.write_bytes(content[: len(content) // 2])
            os.kill(os.getpid(), signal.SIGKILL)
        write(path, content)

    def half_appended(path: Path, content: bytes) -> None:
        if count():
            with path.open("ab") as file:
                file.write(content[: len(content) // 2])
            os.kill(os.getpid(), signal.SIGKILL)
        append(path, content)

    from hprs.training import files

    write, append = files.write, files.append
    files.write, files.append = half, half_appended
    for name in ("rename", "replace", "unlink", "mkdir"):
        setattr(Path, name, dying(getattr(Path, name)))
    os.rmdir = dying(os.rmdir)


if __name__ == "__main__":
    _, out, mode, kind, *numbers = sys.argv
    # A pool of threads would not survive the forks.
    torch.set_num_threads(1)
    made = KINDS[kind](Path(out))
    (at_random if mode == "random" else at_each_change)(Path(out), made, *map(int, numbers))
