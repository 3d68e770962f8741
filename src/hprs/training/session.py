"""What a trainer in JAX offers to the loop around it, and that loop.

The loop evaluates, records, saves, resumes and stops; a session learns. It is the same for every
algorithm and for environments on the device and on the host.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Protocol

from hprs.deploy import Bundle
from hprs.deploy.archive import to_bytes
from hprs.errors import RunError
from hprs.semantics.assessment import Summary, summarise
from hprs.training.checkpoint import Checkpoint, Progress
from hprs.training.configuration import Configuration
from hprs.training.evaluation import Episode, training_seeds
from hprs.training.evaluation_table import format_rows
from hprs.training.events import EventWriter
from hprs.training.interruption import Interruption
from hprs.training.listener import Listener, Silence
from hprs.training.run_directory import RunDirectory, Which

POLICY = "policy.bundle"
TRAINER = "jax"


class Stopped(Exception):  # noqa: N818
    """Leaves an evaluation that is not waited for."""


class Session(Protocol):
    """A training in progress."""

    @property
    def step(self) -> int:
        """Environment steps so far."""
        ...

    @property
    def scalars(self) -> Mapping[str, float]:
        """What is told of the newest update."""
        ...

    def restore(self, contents: Mapping[str, bytes]) -> list[str]:
        """Go on from what `capture` returned.

        Returns:
            For every episode that could not go on the reason.
        """
        ...

    def capture(self) -> dict[str, bytes]:
        """The whole state: name to content."""
        ...

    def advance(self, until: int) -> None:
        """Learn for a while, at least one update, at most as far as a step."""
        ...

    def is_finite(self) -> bool:
        """Whether the networks hold numbers: no step of learning brings back NaN or infinity."""
        ...

    def evaluate(self, seeds: Sequence[int], watch: Callable[[int], None]) -> list[Episode]:
        """Run the policy on one episode a seed; what `watch` raises ends it."""
        ...

    def bundle(self, provenance: Mapping[str, object]) -> Bundle:
        """The policy as it is now."""
        ...

    def close(self) -> None:
        """Close what the session holds."""
        ...


def train(
    run: RunDirectory,
    listener: Listener | None,
    start: Callable[[Configuration, Callable[[str], None]], Session],
) -> bool:
    """Train to the end of the configuration, from the newest checkpoint if there is one.

    The first SIGINT (Ctrl-C) or SIGTERM stops where the state is whole, and saves it.

    Args:
        run: The run directory.
        listener: Hears of the progress.
        start: Makes the session of a configuration, that has not learned anything; it is given
            what tells whoever watches something in a line.

    Returns:
        Whether the training is complete; false if it was interrupted.

    Raises:
        RunError: The run cannot be read, written or gone on with, another process trains it, or the
            training diverged.
    """
    listener = listener or Silence()
    with run.locked():
        checkpoint = run.open(listener.noticed)
        configuration = run.configuration
        if checkpoint is not None:
            # What a kill between the checkpoint and its policies has left undone.
            _keep_policies(run, checkpoint)
            if checkpoint.progress.step >= configuration.steps:
                listener.noticed(f"{run.path} is complete: {checkpoint.progress.step:,} steps.")
                return True
            if run.changed_versions:
                listener.noticed(
                    f"{run.path} was begun with {', '.join(run.changed_versions)}. "
                    "The numbers may not be those of an uninterrupted training."
                )
        with Interruption(listener.stopping) as interruption:
            session = start(configuration, listener.noticed)
            try:
                return _Loop(run, session, checkpoint, listener, interruption).run()
            finally:
                listener.ended()
                session.close()


class _Loop:
    """One training from where it stands to its end."""

    def __init__(
        self,
        run: RunDirectory,
        session: Session,
        checkpoint: Checkpoint | None,
        listener: Listener,
        interruption: Interruption,
    ) -> None:
        self._run, self._session, self._listener = run, session, listener
        self._interruption = interruption
        saved = checkpoint or Checkpoint(Progress(), rows="", contents={})
        self._progress, self._rows = saved.progress, saved.rows
        if checkpoint is not None:
            self._restore(checkpoint)

    def run(self) -> bool:
        """Whether the training is complete."""
        steps, session = self._run.configuration.steps, self._session
        self._listener.started(self._run.configuration, session.step)
        with EventWriter(self._run, session.step) as events:
            while True:
                due = session.step >= self._progress.next_evaluation or session.step >= steps
                if due and session.step > self._progress.evaluated:
                    # An abandoned evaluation comes again: the progress still says that it is due.
                    with suppress(Stopped):
                        self._evaluate(events)
                if session.step >= steps and self._progress.evaluated == session.step:
                    return True
                if self._interruption.requested:
                    self._stop()
                    return False
                session.advance(min(self._progress.next_evaluation, steps))
                self._refuse_divergence()
                self._listener.advanced(session.step)

    def _restore(self, checkpoint: Checkpoint) -> None:
        try:
            reasons = self._session.restore(checkpoint.contents)
        except (KeyError, ValueError, TypeError) as error:
            raise self._run.cannot_go_on(
                RunError(f"{self._run.path}: its checkpoint does not fit: {error}.")
            ) from error
        if reasons:
            self._listener.noticed(
                f"{len(reasons)} environments begin a new episode: "
                f"{'; '.join(sorted(set(reasons)))}. The numbers will not be those of an "
                "uninterrupted training."
            )

    def _evaluate(self, events: EventWriter) -> None:
        self._refuse_divergence()
        step, configuration = self._session.step, self._run.configuration
        seeds = training_seeds(self._progress.evaluations, configuration.evaluation_episodes)
        episodes = self._session.evaluate(seeds, self._look_up)
        self._progress = self._progress.after(step, episodes, configuration.interval_after)
        self._rows = format_rows(configuration.task, step, episodes)
        checkpoint = self._save(evaluated=True)
        _keep_policies(self._run, checkpoint)
        summary = summarise([episode.assessment for episode in episodes])
        events.write({**_assessed(summary), **self._session.scalars}, step)
        self._listener.evaluated(step, summary)

    def _look_up(self, complete: int) -> None:
        if self._interruption.requested:
            raise Stopped

    def _stop(self) -> None:
        if self._session.step > self._progress.step:
            self._progress = replace(self._progress, step=self._session.step)
            self._save(evaluated=False)

    def _save(self, *, evaluated: bool) -> Checkpoint:
        self._refuse_divergence()
        bundle = self._session.bundle({"run": str(self._run.path), "step": self._session.step})
        contents = {**self._session.capture(), POLICY: to_bytes(bundle)}
        checkpoint = Checkpoint(self._progress, self._rows, contents)
        self._run.save(checkpoint, evaluated=evaluated)
        return checkpoint

    def _refuse_divergence(self) -> None:
        if not self._session.is_finite():
            raise RunError(
                f"the training diverged before step {self._session.step:,}: its networks hold NaN "
                "or infinity. A smaller learning_rate is the first thing to try."
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


def _assessed(summary: Summary) -> dict[str, float]:
    return {
        "assessment/PAM": summary.pam,
        "assessment/S": summary.safe,
        "assessment/S+T": summary.safe_target,
        "assessment/S+T+C": summary.safe_target_comfort,
        **{f"requirement/{label}": value for label, value in summary.requirements.items()},
    }
