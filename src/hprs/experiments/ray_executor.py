"""Trains the runs of a grid over a Ray cluster, each as a task of it.

Run directories hold everything a training needs, so all nodes must see the folder they are in. A
task whose worker or node dies is given to another one, which goes on from the newest checkpoint.
"""

from __future__ import annotations

import os
import socket
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from hprs.errors import RunError, UsageError
from hprs.training.crew import worker_environment
from hprs.training.environment import require
from hprs.training.interruption import Interruption
from hprs.training.listener import Listener
from hprs.training.population import Audience, Outcome, programs_of, train_population
from hprs.training.provenance import versions
from hprs.training.run_directory import RUN_FILE, RunDirectory
from hprs.training.worker import Reporter

HERE = "local"
"""The address that starts a Ray of its own on this machine, for as long as the grid takes."""

_RETRIES = 10
"""Workers that a task may lose; a training goes on from its checkpoint every time."""
_PATIENCE = 0.2
"""Seconds after which a request to stop is looked for, if nothing has ended."""
_PAUSE = 1.0
"""Seconds between two reports of a number of steps: they travel further than from a process."""
_REACHED = 5.0
"""Seconds in which a cluster must answer."""
_ORPHANED = 60.0
"""Seconds that a process may still hold a run after its node was given up."""


def train_on_ray(
    runs: Sequence[RunDirectory], audience: Audience, *, address: str, workers: int | None = None
) -> list[Outcome]:
    """Train runs to the end of their configurations, over the nodes of a Ray cluster.

    A task takes as many CPUs as its training has threads. Ctrl-C stops all of them where their
    states are whole; a second one stops at once.

    Args:
        runs: The members.
        audience: Hears of the progress.
        address: Of the cluster, as Ray writes it: `auto`, `HOST:6379`, `ray://HOST:10001`, or
            `local` for one that is started here.
        workers: Tasks that train side by side, at most; None: as many as the cluster has room for.
            0: a task trains all members of a program at once, with a GPU where there are any.

    Returns:
        How each ended, in the order of the runs.

    Raises:
        MissingExtraError: Ray is not installed.
        UsageError: There is no cluster at the address.
    """
    ray = require("ray", "ray")
    with _connected(ray, address):
        groups = programs_of(runs) if workers == 0 else [[run] for run in runs]
        return _Cluster(ray, audience, groups, workers).train(runs)


class _Cluster:
    """The tasks of a grid on a cluster, seen from the process that shows them."""

    def __init__(
        self,
        ray: Any,
        audience: Audience,
        groups: Sequence[Sequence[RunDirectory]],
        workers: int | None,
    ) -> None:
        self._ray, self._audience = ray, audience
        self._waiting = deque(groups)
        self._room = workers or len(groups)
        self._programs = workers == 0
        self._running: dict[Any, Sequence[RunDirectory]] = {}
        self._listeners: dict[Path, _Attentive] = {}
        self._outcomes: dict[RunDirectory, Outcome] = {}
        self._mailbox = ray.remote(_Mailbox).options(**_UNDYING).remote()

    def train(self, runs: Sequence[RunDirectory]) -> list[Outcome]:
        """How each run ended, in their order."""
        stopping = False
        with Interruption(self._audience.stopping) as interruption:
            try:
                while self._waiting or self._running:
                    if interruption.requested and not stopping:
                        stopping = True
                        self._stop()
                    self._submit()
                    self._listen()
            except KeyboardInterrupt:
                self._give_up(runs)
        return [self._outcomes[run] for run in runs]

    def _submit(self) -> None:
        while self._waiting and len(self._running) < self._room:
            group = self._waiting.popleft()
            for run in group:
                self._listeners[run.path.resolve()] = _Attentive(run, self._audience)
            paths = [str(run.path.resolve()) for run in group]
            task = self._ray.remote(_train).options(**self._needs(group))
            reference = task.remote(
                paths, self._mailbox, 0 if self._programs else 1, versions()["hprs"]
            )
            self._running[reference] = group

    def _needs(self, group: Sequence[RunDirectory]) -> Mapping[str, Any]:
        """What Ray must know to place a task."""
        threads = max(run.configuration.parameters.get("threads", 1) for run in group)
        gpus = bool(self._programs and self._ray.cluster_resources().get("GPU"))
        return {
            "num_cpus": threads,
            "num_gpus": int(gpus),
            "max_retries": _RETRIES,
            # A worker keeps what it has imported; settings are read while it imports.
            "runtime_env": {"env_vars": {} if gpus else worker_environment({})},
        }

    def _listen(self) -> None:
        """Pass on what the tasks tell, and take what has ended."""
        ended, _ = self._ray.wait(
            list(self._running), num_returns=len(self._running), timeout=_PATIENCE
        )
        for path, kind, content in self._ray.get(self._mailbox.take.remote()):
            self._listeners[Path(path)].tell(kind, content)
        for reference in ended:
            for outcome in self._result(reference, self._running.pop(reference)):
                self._settle(outcome)

    def _result(self, reference: Any, group: Sequence[RunDirectory]) -> list[Outcome]:
        try:
            found = self._ray.get(reference)
        except self._ray.exceptions.TaskCancelledError:
            return [Outcome(run, "interrupted") for run in group]
        except self._ray.exceptions.RayError as error:
            # What a task has raised is a fault of ours; what is left is that its workers died.
            if isinstance(error, self._ray.exceptions.RayTaskError):
                raise
            text = f"Ray gave it up after {_RETRIES} retries: {_first_line(error)}"
            return [Outcome(run, "failed", text) for run in group]
        return [Outcome(run, *result) for run, result in zip(group, found, strict=True)]

    def _settle(self, outcome: Outcome) -> None:
        self._outcomes[outcome.run] = outcome
        self._audience.settled(outcome)

    def _stop(self) -> None:
        """Begin nothing more, and ask the running trainings to stop."""
        while self._waiting:
            for run in self._waiting.popleft():
                self._settle(Outcome(run, "interrupted"))
        for reference in self._running:
            self._ray.cancel(reference)

    def _give_up(self, runs: Sequence[RunDirectory]) -> None:
        for reference in self._running:
            self._ray.cancel(reference, force=True)
        for run in runs:
            if run not in self._outcomes:
                self._settle(Outcome(run, "interrupted"))


class _Attentive:
    """Passes on what a task tells of a run, and notes when another worker has taken it over."""

    def __init__(self, run: RunDirectory, audience: Audience) -> None:
        self._run, self._audience = run, audience
        self._listener: Listener | None = None

    def tell(self, kind: str, content: Sequence[Any]) -> None:
        """Pass it on; the first word of a run is the begin of its turn."""
        if self._listener is None:
            self._listener = self._audience.member(self._run)
        elif kind == "started":
            self._listener.noticed(f"its worker was lost; another goes on from step {content[0]:,}")
        if kind == "started":
            content = [self._run.configuration, *content]
        getattr(self._listener, kind)(*content)


class _Mailbox:
    """What tasks have told since it was last asked: an actor, which every node can reach."""

    def __init__(self) -> None:
        self._messages: list[tuple[str, str, Sequence[Any]]] = []

    def put(self, path: str, kind: str, content: Sequence[Any]) -> None:
        """Take a message about a run."""
        self._messages.append((path, kind, content))

    def take(self) -> list[tuple[str, str, Sequence[Any]]]:
        """Give all messages away."""
        messages, self._messages = self._messages, []
        return messages


_UNDYING: Mapping[str, Any] = {"num_cpus": 0, "max_restarts": -1, "max_task_retries": -1}
"""Of the mailbox: if its node dies, another one goes on with an empty one, and little is missed."""


class _Senders:
    """The audience of a task: everything goes into the mailbox."""

    def __init__(self, mailbox: Any) -> None:
        self._mailbox = mailbox

    def member(self, run: RunDirectory) -> Reporter:
        """Who passes on the progress of a run."""
        return Reporter(self._sender(run), pause=_PAUSE)

    def settled(self, outcome: Outcome) -> None:
        """Nothing: it is the result of the task."""

    def stopping(self) -> None:
        """Nothing: who has asked for it knows."""

    def _sender(self, run: RunDirectory) -> Callable[..., None]:
        def send(kind: str, *content: Any) -> None:
            self._mailbox.put.remote(str(run.path), kind, content)

        return send


def _train(paths: Sequence[str], mailbox: Any, workers: int, version: str) -> list[tuple[str, str]]:
    """Train the runs of a task, on whichever node it is: state and text of each outcome."""
    found = versions()["hprs"]
    if found != version:
        wrong = f"its node has hprs {found}, and the grid was started with {version}."
        return [("failed", wrong) for _ in paths]
    runs = [RunDirectory(Path(path)) for path in paths]
    if not all((run.path / RUN_FILE).exists() for run in runs):
        unseen = "its node does not see its folder: all nodes must share that of --out."
        return [("failed", unseen) for _ in paths]
    for run in runs:
        # The process of a node that was lost may live a little longer than the node.
        with suppress(RunError), run.locked(patience=_ORPHANED):
            pass
    outcomes = train_population(runs, _Senders(mailbox), workers=workers)
    return [(outcome.state, outcome.text) for outcome in outcomes]


@contextmanager
def _connected(ray: Any, address: str) -> Iterator[None]:
    """A connection to a cluster, or a cluster of its own, for as long as the block takes."""
    # Without it Ray warns that a later version changes what a worker without GPUs sees.
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    options: Mapping[str, Any] = {"log_to_driver": False, "logging_level": "ERROR"}
    if address == HERE:
        options = {**options, "include_dashboard": False}
    try:
        _reach(address)
        ray.init(address, **options)
    except (OSError, ValueError) as error:
        raise UsageError(
            f"There is no Ray cluster at '{address}' ({_first_line(error)}). Start one with "
            f"`ray start --head` and give its address, or `{HERE}` for one on this machine."
        ) from error
    try:
        yield
    finally:
        ray.shutdown()


def _reach(address: str) -> None:
    """Raise an OSError where nobody listens: Ray would try again for minutes."""
    host, _, port = address.rpartition("://")[2].rpartition(":")
    if host and port.isdecimal():
        socket.create_connection((host, int(port)), timeout=_REACHED).close()


def _first_line(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return lines[0] if lines else type(error).__name__
