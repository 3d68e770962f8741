"""Trains several runs: one after the other in this process, or side by side in others.

The fastest way to train many small networks on a CPU is a process a core, each with one run at a
time and without threads of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias

from hprs.errors import HprsError
from hprs.training.configuration import Configuration
from hprs.training.interruption import Interruption
from hprs.training.listener import Listener
from hprs.training.run_directory import RunDirectory
from hprs.training.trainers import Train, together_of, trainer_of

State: TypeAlias = Literal["complete", "interrupted", "failed"]

FindTrainer: TypeAlias = Callable[[Configuration], Train]
"""Finds what trains a configuration; worker processes must be able to import it."""


@dataclass(frozen=True)
class Outcome:
    """How a member's training ended."""

    run: RunDirectory
    """The member."""
    state: State
    """Complete; interrupted, so that it can go on; or failed."""
    text: str = ""
    """Why it failed."""


class Audience(Protocol):
    """Hears of the progress of a population."""

    def member(self, run: RunDirectory) -> Listener:
        """Who hears of the progress of a member; asked when its turn has come."""
        ...

    def settled(self, outcome: Outcome) -> None:
        """A member is done with, or will not be begun any more."""
        ...

    def stopping(self) -> None:
        """The trainings were asked to stop and will, as soon as their state can be saved."""
        ...


def train_population(
    runs: Sequence[RunDirectory],
    audience: Audience,
    *,
    workers: int = 1,
    find_trainer: FindTrainer = trainer_of,
) -> list[Outcome]:
    """Train runs to the end of their configurations.

    A member that fails does not stop the others. The first SIGINT (Ctrl-C) or SIGTERM stops all of
    them where their states are whole; a second one stops at once.

    Args:
        runs: The members.
        audience: Hears of the progress.
        workers: Processes that train side by side; with one, this process trains. With 0, it trains
            all members of a program at once, which is fastest on a GPU.
        find_trainer: Finds what trains a configuration.

    Returns:
        How each ended, in the order of the runs.
    """
    if workers == 0:
        return _train_programs(runs, audience)
    if min(workers, len(runs)) > 1:
        from hprs.training.crew import Crew

        return Crew(runs, audience, min(workers, len(runs)), find_trainer).train()
    return _train_here(runs, audience, find_trainer)


def train_member(run: RunDirectory, listener: Listener, find_trainer: FindTrainer) -> Outcome:
    """Train one run; what is wrong with it becomes its outcome."""
    try:
        complete = find_trainer(run.configuration)(run, listener)
    except HprsError as error:
        return _outcome(run, error)
    return _outcome(run, complete)


def programs_of(runs: Sequence[RunDirectory]) -> list[list[RunDirectory]]:
    """Runs in groups, each of which is trained as one program."""
    programs: dict[str, list[RunDirectory]] = {}
    for run in runs:
        found = together_of(run.configuration)
        programs.setdefault(str(run.path) if found is None else found[0], []).append(run)
    return list(programs.values())


def _train_here(
    runs: Sequence[RunDirectory], audience: Audience, find_trainer: FindTrainer
) -> list[Outcome]:
    outcomes: list[Outcome] = []
    for run in runs:
        stopped = bool(outcomes) and outcomes[-1].state == "interrupted"
        outcome = Outcome(run, "interrupted")
        if not stopped:
            with suppress(KeyboardInterrupt):
                outcome = train_member(run, audience.member(run), find_trainer)
        audience.settled(outcome)
        outcomes.append(outcome)
    return outcomes


def _train_programs(runs: Sequence[RunDirectory], audience: Audience) -> list[Outcome]:
    """Train the members of each program at once, one program after the other."""
    outcomes: dict[RunDirectory, Outcome] = {}
    with Interruption(audience.stopping) as interruption:
        for members in programs_of(runs):
            stopped = any(outcome.state == "interrupted" for outcome in outcomes.values())
            if interruption.requested or stopped:
                ended = [Outcome(run, "interrupted") for run in members]
            else:
                ended = _train_program(members, audience, interruption)
            for outcome in ended:
                outcomes[outcome.run] = outcome
                audience.settled(outcome)
    return [outcomes[run] for run in runs]


def _train_program(
    members: Sequence[RunDirectory], audience: Audience, interruption: Interruption
) -> list[Outcome]:
    found = together_of(members[0].configuration)
    if found is None:
        return [train_member(members[0], audience.member(members[0]), trainer_of)]
    listeners = [audience.member(run) for run in members]
    try:
        ends = found[1](members, listeners, interruption)
    except HprsError as error:
        return [Outcome(run, "failed", _in_a_line(error)) for run in members]
    return [_outcome(run, end) for run, end in zip(members, ends, strict=True)]


def _outcome(run: RunDirectory, end: bool | HprsError) -> Outcome:
    if isinstance(end, HprsError):
        return Outcome(run, "failed", _in_a_line(end))
    return Outcome(run, "complete" if end else "interrupted")


def _in_a_line(error: HprsError) -> str:
    return " ".join(str(error).split())
