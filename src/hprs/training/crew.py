"""Worker processes that train the members of a population, each one run at a time."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import connection
from typing import Any

from hprs.training.interruption import Interruption
from hprs.training.listener import Listener
from hprs.training.population import Audience, FindTrainer, Outcome
from hprs.training.run_directory import RunDirectory
from hprs.training.worker import work

# JAX, where it has been loaded, survives no fork.
_CONTEXT = multiprocessing.get_context("spawn")

_PATIENCE = 0.2
"""Seconds after which a request to stop is looked for, if no worker tells anything."""

_THREADS = {"--xla_cpu_multi_thread_eigen": "false", "intra_op_parallelism_threads": "1"}
"""Flags with which XLA computes without threads of its own."""


class Crew:
    """Trains runs over processes; see `train_population`.

    Args:
        runs: The members.
        audience: Hears of the progress.
        size: How many processes work side by side.
        find_trainer: Finds what trains a configuration.
    """

    def __init__(
        self,
        runs: Sequence[RunDirectory],
        audience: Audience,
        size: int,
        find_trainer: FindTrainer,
    ) -> None:
        self._runs, self._audience, self._find_trainer = runs, audience, find_trainer
        self._waiting = deque(runs)
        self._outcomes: dict[RunDirectory, Outcome] = {}
        self._places: list[_Worker | None] = [None] * size
        self._cores = _cores(runs)
        self._stopping = False

    def train(self) -> list[Outcome]:
        """How each run ended, in their order."""
        with Interruption(self._audience.stopping) as interruption:
            try:
                while len(self._outcomes) < len(self._runs):
                    if interruption.requested and not self._stopping:
                        self._stop()
                    self._fill()
                    self._listen()
            except KeyboardInterrupt:
                self._give_up()
            finally:
                for worker in self._working:
                    worker.end()
        return [self._outcomes[run] for run in self._runs]

    @property
    def _working(self) -> list[_Worker]:
        return [worker for worker in self._places if worker is not None]

    def _fill(self) -> None:
        """Let somebody work at every place, as long as there are runs."""
        for place, worker in enumerate(self._places):
            if worker is None and self._waiting:
                core = self._cores[place % len(self._cores)] if self._cores else None
                self._places[place] = hired = _Worker(core, self._find_trainer)
                self._hand(hired)

    def _hand(self, worker: _Worker) -> None:
        run = self._waiting.popleft()
        worker.take(run, self._audience.member(run))

    def _listen(self) -> None:
        """Pass on what the workers tell, for a moment."""
        by_pipe: dict[Any, _Worker] = {worker.pipe: worker for worker in self._working}
        for pipe in connection.wait(list(by_pipe), _PATIENCE):
            worker = by_pipe[pipe]
            try:
                kind, *content = worker.pipe.recv()
            # A killed process may leave half a message, or none.
            except (EOFError, OSError):
                self._lose(worker)
                continue
            if kind == "outcome":
                self._settle(Outcome(worker.run, *content))
                self._hand(worker) if self._waiting else self._dismiss(worker)
            else:
                worker.tell(kind, content)

    def _lose(self, worker: _Worker) -> None:
        """A process has ended without saying how the training went."""
        self._dismiss(worker)
        code = worker.process.exitcode
        if self._stopping:
            # It was asked to stop before the training could listen.
            self._settle(Outcome(worker.run, "interrupted"))
            return
        how = f"was killed ({_name(-code)})" if code and code < 0 else f"ended with code {code}"
        self._settle(Outcome(worker.run, "failed", f"its process {how}."))

    def _settle(self, outcome: Outcome) -> None:
        self._outcomes[outcome.run] = outcome
        self._audience.settled(outcome)

    def _dismiss(self, worker: _Worker) -> None:
        worker.end()
        self._places[self._places.index(worker)] = None

    def _stop(self) -> None:
        """Begin nothing more, and ask the running trainings to stop."""
        self._stopping = True
        while self._waiting:
            self._settle(Outcome(self._waiting.popleft(), "interrupted"))
        for worker in self._working:
            worker.process.terminate()

    def _give_up(self) -> None:
        for worker in self._working:
            worker.process.kill()
        for run in self._runs:
            if run not in self._outcomes:
                self._settle(Outcome(run, "interrupted"))


class _Worker:
    """A process that trains, seen from outside.

    Args:
        core: The core that it computes on; None: any.
        find_trainer: Finds what trains a configuration.
    """

    run: RunDirectory
    """What it trains now."""

    def __init__(self, core: int | None, find_trainer: FindTrainer) -> None:
        self.pipe, theirs = _CONTEXT.Pipe()
        self.process = _CONTEXT.Process(target=work, args=(theirs, core, find_trainer))
        with _without_threads(), _uninterrupted():
            self.process.start()
        # Otherwise its end would not be noticed: we would hold the pipe open ourselves.
        theirs.close()

    def take(self, run: RunDirectory, listener: Listener) -> None:
        """Give it a run to train."""
        self.run, self._listener = run, listener
        # If it has died, this is noticed where it is listened to.
        with suppress(OSError):
            self.pipe.send(run.path)

    def tell(self, kind: str, content: Sequence[Any]) -> None:
        """Pass on what it has said to whoever hears of its run."""
        if kind == "started":
            content = [self.run.configuration, *content]
        getattr(self._listener, kind)(*content)

    def end(self) -> None:
        """Wait for the process, which ends when nobody listens to it any more."""
        self.pipe.close()
        self.process.join(10.0)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()


def worker_environment(current: Mapping[str, str]) -> dict[str, str]:
    """The environment variables with which a worker starts, beside others; what is set stays."""
    flags = current.get("XLA_FLAGS", "")
    added = [f"{name}={value}" for name, value in _THREADS.items() if name not in flags]
    return {
        "OMP_NUM_THREADS": current.get("OMP_NUM_THREADS", "1"),
        "XLA_FLAGS": " ".join([flags, *added]).strip(),
    }


@contextmanager
def _without_threads() -> Iterator[None]:
    # A process reads them while it imports, so they must be there before it starts.
    ours = worker_environment(os.environ)
    before = {name: os.environ.get(name) for name in ours}
    os.environ.update(ours)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Let Ctrl-C wait, here and in the process that is started, which unblocks it when ready."""
    if os.name != "posix":
        yield
        return
    from multiprocessing import resource_tracker

    # It would unblock the signal, if it started later.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _cores(runs: Sequence[RunDirectory]) -> list[int]:
    """The cores to bind processes to; none where the system cannot, or they want several."""
    threads = max(run.configuration.parameters.get("threads", 1) for run in runs)
    if threads > 1 or not hasattr(os, "sched_getaffinity"):
        return []
    return sorted(os.sched_getaffinity(0))


def _name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
