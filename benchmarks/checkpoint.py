"""What a checkpoint costs at a million transitions of the bipedal walker, with SAC.

The buffer is filled with random rows. "Before" is what Stable-Baselines3 offers: the whole buffer
in one pickle, which is not written through to the disk.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from hprs.training.checkpoint import Checkpoint, Progress
from hprs.training.configure import configure
from hprs.training.listener import Silence
from hprs.training.replay import Segment
from hprs.training.run_directory import RunDirectory, create_runs
from hprs.training.sb3.model import make_model, make_vector
from hprs.training.sb3.state import capture, replay_ring
from hprs.training.sb3.training import open_model

INTERVAL = 10_000
"""Transitions between two checkpoints."""


def fill(model: Any, count: int) -> None:
    """Add random rows to the replay buffer, as a training would in so many steps."""
    buffer, generator = model.replay_buffer, np.random.default_rng(model.num_timesteps)
    places = np.arange(model.num_timesteps, model.num_timesteps + count) % buffer.buffer_size
    for name in ("observations", "next_observations", "actions", "rewards"):
        array = getattr(buffer, name)
        array[places] = generator.standard_normal((count, *array.shape[1:]), np.float32)
    model.num_timesteps += count
    buffer.pos = model.num_timesteps % buffer.buffer_size
    buffer.full = model.num_timesteps >= buffer.buffer_size


def checkpoint(run: RunDirectory, model: Any, known: tuple[Segment, ...]) -> tuple[Segment, ...]:
    """Save a training as it does itself."""
    progress = Progress(step=model.num_timesteps)
    saved = Checkpoint(progress, "", capture(model), known)
    return run.save(saved, evaluated=False, ring=replay_ring(model)).segments


def timed(work: Callable[[], Any]) -> tuple[float, Any]:
    """Seconds that work takes, and its result."""
    start = time.perf_counter()
    result = work()
    return time.perf_counter() - start, result


def megabytes(*places: Path) -> float:
    """Size of files and folders."""
    every = [file for place in places for file in (place, *place.rglob("*"))]
    return sum(file.stat().st_size for file in every if file.is_file()) / 1e6


def measure(transitions: int, folder: Path, repeats: int) -> None:
    """Print every figure."""
    settings = {"buffer_size": transitions, "net_arch": [256, 256]}
    configuration = configure(
        "hprs/BipedalWalker-v0",
        algorithm="sac",
        trainer="sb3",
        settings=settings,
        steps=10 * transitions,
    )
    [run] = create_runs([configuration], folder)
    environments = make_vector(configuration)
    model: Any = make_model(configuration, environments)
    environments.seed(0)
    model._setup_learn(0, None)
    fill(model, transitions - INTERVAL)
    seconds, segments = timed(lambda: checkpoint(run, model, ()))
    print(f"everything at once, which never happens: {seconds:.2f} s")

    times = []
    for _ in range(repeats):
        fill(model, INTERVAL)
        seconds, segments = timed(lambda known=segments: checkpoint(run, model, known))
        times.append(seconds)
    print(
        f"checkpoint every {INTERVAL:,} steps: {np.median(times):.2f} s, at most {max(times):.2f} s"
    )
    print(f"on disk: {megabytes(run.replay, run.path / 'checkpoint'):.0f} MB")

    kept = RunDirectory(run.path)
    seconds, found = timed(kept.checkpoint)
    again, opened = timed(lambda: open_model(kept, found, make_vector(configuration), Silence()))
    print(f"to load all of it: {seconds + again:.2f} s")
    restored: Any = opened[0]
    fill(restored, INTERVAL)
    seconds, _ = timed(lambda: checkpoint(kept, restored, found.segments))
    print(f"first checkpoint after resuming: {seconds:.2f} s")

    pickled = folder / "replay.pkl"
    seconds, _ = timed(lambda: model.save_replay_buffer(pickled))
    print(f"before, each checkpoint: {seconds:.2f} s and {megabytes(pickled):.0f} MB written")


def main() -> None:
    """Parse the arguments and measure."""
    parser = argparse.ArgumentParser(description="What a checkpoint costs.")
    parser.add_argument("--transitions", type=int, default=1_000_000)
    parser.add_argument("--repeats", type=int, default=10)
    parser.add_argument("--folder", help="where to write; default: a temporary folder")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=arguments.folder) as folder:
        measure(arguments.transitions, Path(folder), arguments.repeats)


if __name__ == "__main__":
    main()
