"""A worker process that trains the members of a population, seen from inside."""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from hprs.semantics.assessment import Summary
from hprs.training.configuration import Configuration
from hprs.training.population import FindTrainer, train_member
from hprs.training.run_directory import RunDirectory

_GRACE = 60.0
"""Seconds to stop in, when the process that started this one is gone."""

_PAUSE = 0.1
"""Seconds between two reports of a number of steps, to a process beside this one."""


def work(pipe: Connection, core: int | None, find_trainer: FindTrainer) -> None:
    """Train one run after the other, until nobody sends any.

    Args:
        pipe: Paths of runs come from it; what a listener is told, and outcomes, go there.
        core: The core to compute on; None: any.
        find_trainer: Finds what trains a configuration.
    """
    # Where compiled code dies, say where.
    faulthandler.enable()
    _detach()
    if core is not None:
        os.sched_setaffinity(0, {core})
    threading.Thread(target=_follow_parent, daemon=True).start()
    while (path := _next(pipe)) is not None:
        outcome = train_member(RunDirectory(path), Reporter(partial(_send, pipe)), find_trainer)
        _send(pipe, "outcome", outcome.state, outcome.text)


class Reporter:
    """A listener that passes everything on to another process.

    Args:
        send: Takes the name of what a listener is told, and its arguments.
        pause: Seconds between two reports of a number of steps.
    """

    def __init__(self, send: Callable[..., None], *, pause: float = _PAUSE) -> None:
        self._send, self._pause = send, pause
        self._reported = 0.0

    def started(self, configuration: Configuration, step: int) -> None:
        """Pass the step on; the configuration is known there."""
        self._send("started", step)

    def advanced(self, step: int) -> None:
        """Pass it on, unless the last one has just been."""
        now = time.monotonic()
        if now - self._reported > self._pause:
            self._reported = now
            self._send("advanced", step)

    def evaluated(self, step: int, summary: Summary) -> None:
        """Pass it on."""
        self._send("evaluated", step, summary)

    def noticed(self, text: str) -> None:
        """Pass it on."""
        self._send("noticed", text)

    def stopping(self) -> None:
        """Nothing: who has asked for it knows."""

    def ended(self) -> None:
        """Pass it on."""
        self._send("ended")


def _detach() -> None:
    """Leave Ctrl-C to the process that started this one, which asks with SIGTERM instead."""
    if os.name != "posix":
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        return
    os.setpgid(0, 0)
    # One that came since is dropped.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    signal.signal(signal.SIGINT, signal.default_int_handler)


def _follow_parent() -> None:
    """Stop, as if asked to, when the process that started this one is gone."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(_GRACE)
        os._exit(1)


def _next(pipe: Connection) -> Path | None:
    with suppress(EOFError, OSError):
        return pipe.recv()
    return None


def _send(pipe: Connection, *message: Any) -> None:
    # Nobody may be there any more; then there is nothing to tell.
    with suppress(OSError):
        pipe.send(message)
