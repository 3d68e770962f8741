"""What a trainer in JAX offers to the loop around it, and that loop.

The loop evaluates, records, saves, resumes and stops; a session learns. It is the same for every
algorithm and for environments on the device and on the host.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from typing import Protocol, TypeAlias

from hprs.deploy import Bundle
from hprs.deploy.archive import to_bytes
from hprs.errors import RunError
from hprs.semantics.assessment import summarise
from hprs.training.checkpoint import Checkpoint, Progress
from hprs.training.configuration import Configuration
from hprs.training.evaluation import Episode, training_seeds
from hprs.training.evaluation_table import format_rows
from hprs.training.events import EventWriter, assessment_scalars
from hprs.training.interruption import Interruption, Stopped
from hprs.training.listener import Listener, Silence
from hprs.training.provenance import versions
from hprs.training.replay import Ring, Segment, load_segments
from hprs.training.run_directory import RunDirectory, Which

POLICY = "policy.bundle"
TRAINER = "jax"


class Session(Protocol):
    """Trainings in progress: the members of one program, which learn in step with each other."""

    @property
    def notice(self) -> str:
        """What is to be said before it begins; empty if there is nothing."""
        ...

    @property
    def step(self) -> int:
        """Environment steps of each member so far."""
        ...

    def scalars(self, member: int) -> Mapping[str, float]:
        """What is told of a member's newest update."""
        ...

    def restore(self, member: int, contents: Mapping[str, bytes]) -> list[str]:
        """Go on from what `capture` returned.

        Returns:
            For every episode that could not go on the reason.
        """
        ...

    def capture(self, member: int) -> dict[str, bytes]:
        """The whole state of a member: name to content."""
        ...

    def ring(self, member: int) -> Ring | None:
        """The replay buffer of a member, which `capture` leaves out; None where there is none.

        After `restore` it has room for the rows that it had, and waits for them.
        """
        ...

    def advance(self, until: int) -> None:
        """Learn for a while: at least one update, and none that begins at a step or beyond it."""
        ...

    def is_finite(self, member: int) -> bool:
        """Whether its networks hold numbers: no step of learning brings back NaN or infinity."""
        ...

    def evaluate(
        self, seeds: Sequence[int], watch: Callable[[int], None]
    ) -> Sequence[list[Episode]]:
        """Run every member's policy on one episode a seed; what `watch` raises ends it.

        Returns:
            The episodes of each member; of one that has diverged there may be none.
        """
        ...

    def bundle(self, member: int, provenance: Mapping[str, object]) -> Bundle:
        """A member's policy as it is now."""
        ...

    def close(self) -> None:
        """Close what the session holds."""
        ...


Start: TypeAlias = Callable[[Sequence[Configuration]], Session]
"""Makes the session of some configurations, in which nothing is learned yet; they make one program,
see `program_of` of the algorithm."""


def train(run: RunDirectory, listener: Listener | None, start: Start) -> bool:
    """Train to the end of the configuration, from the newest checkpoint if there is one.

    The first SIGINT (Ctrl-C) or SIGTERM stops where the state is whole, and saves it.

    Args:
        run: The run directory.
        listener: Hears of the progress.
        start: Makes the session.

    Returns:
        Whether the training is complete; false if it was interrupted.

    Raises:
        RunError: The run cannot be read, written or gone on with, another process trains it, or the
            training diverged.
    """
    with Interruption((listener or Silence()).stopping) as interruption:
        [end] = train_together([run], [listener or Silence()], start, interruption)
    if isinstance(end, RunError):
        raise end
    return end


def train_together(
    runs: Sequence[RunDirectory],
    listeners: Sequence[Listener],
    start: Start,
    interruption: Interruption,
) -> list[bool | RunError]:
    """Train runs in one program.

    Members that were stopped at different places go on one after the other, those at one place
    together. One that fails does not stop the others.

    Args:
        runs: The run directories.
        listeners: Hear of the progress, one of each run.
        start: Makes the session.
        interruption: Asks the trainings to stop.

    Returns:
        Of each run whether it is complete, or what is wrong with it.
    """
    seats = [_Seat(run, listener) for run, listener in zip(runs, listeners, strict=True)]
    with ExitStack() as stack:
        for seat in seats:
            seat.open(stack)
        while waiting := [seat for seat in seats if seat.end is None]:
            first = min(seat.place for seat in waiting)
            group = [seat for seat in waiting if seat.place == first]
            if interruption.requested:
                for seat in group:
                    seat.end = False
                continue
            _train(group, start, interruption)
    return [seat.end if seat.end is not None else False for seat in seats]


def _train(seats: list[_Seat], start: Start, interruption: Interruption) -> None:
    """Train runs that are at the same step to their ends."""
    configurations = [seat.run.configuration for seat in seats]
    session = start(configurations)
    try:
        if session.notice:
            seats[0].listener.noticed(session.notice)
        for member, seat in enumerate(seats):
            seat.take(session, member)
        _Lesson(session, seats, interruption).run()
    finally:
        for seat in seats:
            seat.leave()
        session.close()


class _Lesson:
    """Learning and evaluating in turns, until every run has ended.

    Members are in step: what is due for one is due for all, and one's progress is that of all.
    """

    def __init__(
        self, session: Session, seats: Sequence[_Seat], interruption: Interruption
    ) -> None:
        self._session, self._seats, self._interruption = session, seats, interruption
        self._configuration = seats[0].run.configuration

    def run(self) -> None:
        """Go on to the end."""
        session, steps = self._session, self._configuration.steps
        while self._running:
            self._evaluate_if_due()
            if self._interruption.requested and not self._is_over:
                for seat in self._running:
                    seat.stop()
            elif self._is_over:
                for seat in self._running:
                    seat.end = True
            elif self._running:
                session.advance(min(self._progress.next_evaluation, steps))
                for seat in self._running:
                    seat.advanced()

    @property
    def _running(self) -> list[_Seat]:
        return [seat for seat in self._seats if seat.end is None]

    @property
    def _progress(self) -> Progress:
        return self._running[0].progress

    @property
    def _is_over(self) -> bool:
        """Whether the last step is made and evaluated; not of a lesson that nobody takes."""
        step = self._session.step
        ended = step >= self._configuration.steps
        return ended and bool(self._running) and self._progress.evaluated == step

    def _evaluate_if_due(self) -> None:
        session, progress = self._session, self._progress
        due = session.step >= min(progress.next_evaluation, self._configuration.steps)
        if not due or session.step <= progress.evaluated:
            return
        seeds = training_seeds(progress.evaluations, self._configuration.evaluation_episodes)
        # An abandoned evaluation comes again: the progress still says that it is due.
        with suppress(Stopped):
            found = session.evaluate(seeds, self._look_up)
            for seat in self._running:
                seat.record(found[seat.member])

    def _look_up(self, complete: int) -> None:
        if self._interruption.requested:
            raise Stopped


class _Seat:
    """A run with its progress, and its place in a session."""

    member: int
    """Which of the session's members it is."""

    def __init__(self, run: RunDirectory, listener: Listener) -> None:
        self.run, self.listener = run, listener
        self.progress, self._rows = Progress(), ""
        self._segments: tuple[Segment, ...] = ()
        self.end: bool | RunError | None = None
        """None while it trains; whether it is complete, or what is wrong."""
        self._checkpoint: Checkpoint | None = None
        self._events: EventWriter | None = None
        self._session: Session | None = None

    @contextmanager
    def _attempt(self) -> Iterator[None]:
        """Let what is wrong with this run be its end."""
        try:
            yield
        except RunError as error:
            self.end = error

    @property
    def place(self) -> tuple[int, ...]:
        """How far the run is, and what is due when: members that agree in it stay in step."""
        progress = self.progress
        return progress.step, progress.evaluated, progress.evaluations, progress.next_evaluation

    def open(self, stack: ExitStack) -> None:
        """Lock the run until the end, and find out where it stands."""
        run, listener = self.run, self.listener
        with self._attempt():
            stack.enter_context(run.locked())
            self._checkpoint = run.open(listener.noticed)
            if self._checkpoint is None:
                return
            self.progress, self._rows = self._checkpoint.progress, self._checkpoint.rows
            self._segments = self._checkpoint.segments
            # What a kill between the checkpoint and its policies has left undone.
            _keep_policies(run, self._checkpoint)
            # One that was stopped before its last evaluation is not.
            if self.progress.evaluated >= run.configuration.steps:
                listener.noticed(f"{run.path} is complete: {self.progress.step:,} steps.")
                self.end = True
            elif run.changed_versions:
                listener.noticed(
                    f"{run.path} was begun with {', '.join(run.changed_versions)}. "
                    "The numbers may not be those of an uninterrupted training."
                )

    def take(self, session: Session, member: int) -> None:
        """Become a member of a session, and go on from the checkpoint."""
        self._session, self.member = session, member
        with self._attempt():
            if self._checkpoint is not None:
                self._restore(session, self._checkpoint)
            self._events = EventWriter(self.run, session.step)
            self.listener.started(self.run.configuration, session.step)

    def _restore(self, session: Session, checkpoint: Checkpoint) -> None:
        try:
            reasons = session.restore(self.member, checkpoint.contents)
            if (ring := session.ring(self.member)) is not None:
                load_segments(self.run.replay, ring, checkpoint.segments)
        except RunError as error:
            raise self.run.cannot_go_on(error) from None
        except (KeyError, ValueError, TypeError) as error:
            raise self.run.cannot_go_on(
                RunError(f"{self.run.path}: its checkpoint does not fit: {error}.")
            ) from error
        if reasons:
            self.listener.noticed(
                f"{len(reasons)} environments begin a new episode: "
                f"{'; '.join(sorted(set(reasons)))}. The numbers will not be those of an "
                "uninterrupted training."
            )

    def record(self, episodes: Sequence[Episode]) -> None:
        """Save what an evaluation has found, and the state at it."""
        session, configuration = self._session, self.run.configuration
        if session is None or self._events is None:
            return
        with self._attempt():
            self._refuse_divergence(session)
            step = session.step
            self.progress = self.progress.after(step, episodes, configuration.interval_after)
            self._rows = format_rows(configuration.task, step, episodes)
            _keep_policies(self.run, self._save(session, evaluated=True))
            summary = summarise([episode.assessment for episode in episodes])
            scalars = {**assessment_scalars(summary), **session.scalars(self.member)}
            self._events.write(scalars, step)
            self.listener.evaluated(step, summary)

    def advanced(self) -> None:
        """Tell how far the session has got, unless this member has diverged."""
        if self._session is None:
            return
        with self._attempt():
            self._refuse_divergence(self._session)
            self.listener.advanced(self._session.step)

    def stop(self) -> None:
        """Save the state between two evaluations, and end."""
        if self._session is None:
            return
        with self._attempt():
            if self._session.step > self.progress.step:
                self.progress = replace(self.progress, step=self._session.step)
                self._save(self._session, evaluated=False)
            self.end = False

    def leave(self) -> None:
        """Close what is open."""
        self.listener.ended()
        if self._events is not None:
            with self._attempt():
                self._events.close()

    def _save(self, session: Session, *, evaluated: bool) -> Checkpoint:
        self._refuse_divergence(session)
        provenance = {
            "run": str(self.run.path),
            "step": session.step,
            "written_by": f"hprs {versions().get('hprs', 'of an unknown version')}",
        }
        bundle = to_bytes(session.bundle(self.member, provenance))
        contents = {**session.capture(self.member), POLICY: bundle}
        checkpoint = Checkpoint(self.progress, self._rows, contents, self._segments)
        ring = session.ring(self.member)
        checkpoint = self.run.save(checkpoint, evaluated=evaluated, ring=ring)
        self._segments = checkpoint.segments
        return checkpoint

    def _refuse_divergence(self, session: Session) -> None:
        if not session.is_finite(self.member):
            raise RunError(
                f"the training diverged before step {session.step:,}: its networks hold NaN or "
                "infinity. A smaller learning_rate is the first thing to try."
            )


def _keep_policies(run: RunDirectory, checkpoint: Checkpoint) -> None:
    """Keep the checkpoint's policy as last or best, if it is and has not been kept yet."""
    progress = checkpoint.progress
    kept: tuple[tuple[Which, int], ...] = (
        ("last", progress.evaluated),
        ("best", progress.best_step),
    )
    for which, step in kept:
        if step == progress.step and run.policy_step(which) != step:
            data = checkpoint.contents[POLICY]
            run.save_policy(which, trainer=TRAINER, step=step, name=POLICY, data=data)
