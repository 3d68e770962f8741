"""A trainer that trains nothing; what it does instead, a hyper-parameter says.

Worker processes import it, so it imports little.
"""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from hprs.envs.registration import task_text_of
from hprs.errors import RunError
from hprs.semantics.assessment import Summary
from hprs.training.configuration import Configuration
from hprs.training.interruption import Interruption
from hprs.training.listener import Listener
from hprs.training.run_directory import RunDirectory

ID = "hprs/CartPole-v0"
PATIENCE = 60.0
"""Seconds after which a test that waits has failed."""


def configuration(seed: int, act: str = "finish", **parameters: object) -> Configuration:
    """A training of the stub."""
    text = task_text_of(ID)
    assert text is not None
    found = Configuration(ID, text, "ppo", {"gamma": 0.99, "act": act, **parameters}, 100)
    return replace(found, seed=seed)


def find_stub(configuration: Configuration) -> Callable[[RunDirectory, Listener | None], bool]:
    """Takes the place of `trainer_of`."""
    del configuration
    return train


def train(run: RunDirectory, listener: Listener | None = None) -> bool:
    """Do what the configuration says."""
    assert listener is not None
    write(run, "begun")
    listener.started(run.configuration, 0)
    complete = ACTS[run.configuration.parameters["act"]](run, listener)
    listener.evaluated(100, Summary(1.0, 0.5, 0.4, 1.25, {"slow": 0.5}, 2))
    listener.ended()
    write(run, "complete" if complete else "stopped")
    return complete


def finish(run: RunDirectory, listener: Listener) -> bool:
    """Train at once."""
    listener.advanced(50)
    return True


def diverge(run: RunDirectory, listener: Listener) -> bool:
    """End as a training that diverges."""
    raise RunError("the training diverged\n before step 50.")


def crash(run: RunDirectory, listener: Listener) -> bool:
    """Show a fault of ours."""
    raise ValueError("a fault")


def die(run: RunDirectory, listener: Listener) -> bool:
    """End as by `kill -9`."""
    os.kill(os.getpid(), signal.SIGKILL)
    return False


def meet(run: RunDirectory, listener: Listener) -> bool:
    """Wait until another member of the population has begun too."""
    wait_for(lambda: len(list(run.path.parent.glob("*/begun"))) > 1)
    return True


def stay(run: RunDirectory, listener: Listener) -> bool:
    """Train until asked to stop."""
    with Interruption(listener.stopping) as interruption:
        write(run, "listening")
        wait_for(lambda: interruption.requested)
    return False


def idle(run: RunDirectory, listener: Listener) -> bool:
    """Never look up."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    write(run, "listening")
    time.sleep(PATIENCE)
    return False


ACTS = {act.__name__: act for act in (finish, diverge, crash, die, meet, stay, idle)}


def write(run: RunDirectory, name: str) -> None:
    """Leave a file that says where and how the trainer runs."""
    content = {
        "pid": os.getpid(),
        "cores": sorted(os.sched_getaffinity(0)),
        "threads": os.environ.get("OMP_NUM_THREADS"),
        "flags": os.environ.get("XLA_FLAGS"),
    }
    fresh = run.path / f".{name}"
    fresh.write_text(json.dumps(content))
    fresh.rename(run.path / name)


def read(run: RunDirectory, name: str = "complete") -> dict[str, object]:
    """What such a file says."""
    return json.loads((run.path / name).read_text())


def wait_for(condition: Callable[[], bool]) -> None:
    """Look until something is so."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def alive(pid: object) -> bool:
    """Whether a process runs."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"
