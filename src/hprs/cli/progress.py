"""Shows the progress of a training or an evaluation: a bar on a terminal.

Elsewhere a training prints one line an evaluation, and an evaluation nothing.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from hprs.semantics.assessment import Summary
from hprs.training.configuration import Configuration


class Pace:
    """How fast a training makes steps, without what comes before the first ones: compilation."""

    def __init__(self) -> None:
        self._since: tuple[int, float] | None = None

    def rate(self, step: int) -> float:
        """Steps a second since the first call that told of steps; 0 at that one.

        Args:
            step: How far the training is.
        """
        now = time.monotonic()
        if self._since is None:
            self._since = step, now
        first, start = self._since
        return (step - first) / (now - start) if step > first and now > start else 0.0


class TrainingProgress:
    """A listener of one training that prints.

    Args:
        console: Where to.
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        self._bar: Progress | None = None
        self._task = None
        self._total = 0
        self.trainings = 0
        """How many trainings have started, or gone on."""
        self._pace, self._drawn = Pace(), 0.0

    def started(self, configuration: Configuration, step: int) -> None:
        """Open a bar, or say what starts."""
        self.trainings += 1
        self._total, self._pace = configuration.steps, Pace()
        if not self._console.is_terminal:
            go_on = f", from step {step:,}" if step else ""
            self._say(
                f"{configuration.environment}, {configuration.reward} reward, "
                f"{configuration.algorithm}, {configuration.steps:,} steps{go_on}"
            )
            if beginning(configuration):
                self._say(beginning(configuration))
            return
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.completed:,.0f}/{task.total:,.0f} steps"),
            TextColumn("{task.fields[rate]}"),
            TextColumn("{task.fields[measures]}"),
            TimeRemainingColumn(compact=True),
            console=self._console,
        )
        self._task = self._bar.add_task(
            f"seed {configuration.seed}",
            total=configuration.steps,
            completed=step,
            rate=beginning(configuration),
            measures="",
        )
        self._bar.start()

    def advanced(self, step: int) -> None:
        """Move the bar, ten times a second."""
        rate, now = self._pace.rate(step), time.monotonic()
        if self._bar is not None and self._task is not None and now - self._drawn > 0.1:
            self._drawn = now
            self._bar.update(self._task, completed=step, rate=f"{rate:,.0f}/s" if rate else "")

    def evaluated(self, step: int, summary: Summary) -> None:
        """Show how good the policy is."""
        measures = describe(summary)
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=step, measures=measures)
            return
        timing = pace(self._pace.rate(step), self._total - step) if step else ""
        self._say(f"step {step:>9,}  {measures}{timing}")

    def noticed(self, text: str) -> None:
        """Say it."""
        self._console.print(text, soft_wrap=True)
        self._console.file.flush()

    def stopping(self) -> None:
        """Ask for patience."""
        self._console.print("Stopping as soon as the state can be saved; Ctrl-C again stops now.")

    def ended(self) -> None:
        """Close the bar."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def _say(self, text: str) -> None:
        self._console.print(text, soft_wrap=True)
        self._console.file.flush()


class EvaluationProgress:
    """A bar over the episodes of several policies, gone when it is left.

    Args:
        console: Where to.
        policies: How many policies there are.
        episodes: Episodes of each.
    """

    def __init__(self, console: Console, *, policies: int, episodes: int) -> None:
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.completed:,.0f}/{task.total:,.0f} episodes"),
            TimeRemainingColumn(compact=True),
            console=console,
            transient=True,
            disable=not console.is_terminal,
        )
        self._task = self._bar.add_task("", total=policies * episodes)
        self._each, self._complete, self._drawn = episodes, 0, 0.0

    def __enter__(self) -> EvaluationProgress:
        """Open the bar."""
        self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the bar."""
        self._bar.stop()

    def watcher(self, name: str) -> Callable[[int], None]:
        """What is to be told how many episodes of a policy are complete."""
        before, self._complete = self._complete, self._complete + self._each
        self._bar.update(self._task, description=name, completed=before)

        def watch(complete: int) -> None:
            now = time.monotonic()
            if now - self._drawn > 0.1:
                self._drawn = now
                self._bar.update(self._task, completed=before + complete)

        return watch


def beginning(configuration: Configuration) -> str:
    """What a training does before its first step, where that takes a while."""
    return "compiling (kept for the next time)" if configuration.trainer == "jax" else ""


def describe(summary: Summary) -> str:
    """How good a policy is, in a few numbers."""
    return f"PAM {summary.pam:.2f}  S {summary.safe:.2f}  S+T {summary.safe_target:.2f}"


def pace(rate: float, left: int) -> str:
    """How fast a training is and how long it will take, behind other text.

    Args:
        rate: Steps a second; 0 where it is not known.
        left: Steps that are left.
    """
    return f"  {rate:,.0f} steps/s, {clock(max(0, left) / rate)} left" if rate else ""


def clock(seconds: float) -> str:
    """A time as people read it: minutes and seconds, with hours where there are any."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
