"""Shows the progress of several trainings: on a terminal a bar each and one for all of them.

Elsewhere it prints one line an evaluation.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from types import TracebackType

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from hprs.cli.console import plural
from hprs.cli.progress import Pace, beginning, describe, pace
from hprs.rewards.registry import REWARDS
from hprs.semantics.assessment import Summary
from hprs.training.configuration import Configuration
from hprs.training.population import Outcome
from hprs.training.run_directory import RunDirectory

_PAUSE = 0.1
"""Seconds between two drawings of a bar."""


class PopulationProgress:
    """An audience that prints.

    Args:
        console: Where to.
        runs: The members.
        workers: How many of them are trained side by side.
    """

    def __init__(self, console: Console, runs: Sequence[RunDirectory], workers: int) -> None:
        self.console, self._runs, self._workers = console, runs, workers
        self._labels = dict(zip(runs, labels([run.configuration for run in runs]), strict=True))
        self._members: dict[RunDirectory, Member] = {}
        self._settled = 0
        self._drawn, self._pace = time.monotonic(), Pace()
        self.bar: Progress | None = None
        self._all: TaskID | None = None

    def __enter__(self) -> PopulationProgress:
        """Say what starts, and open the bars."""
        first, total = self._runs[0].configuration, len(self._runs)
        several = f" on {self._workers} processes" if self._workers > 1 else ""
        self.say(
            f"{first.environment}, {first.algorithm}: {plural(total, 'run')}{several}, "
            f"{self._total:,} steps"
        )
        if self.console.is_terminal:
            self.bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(20),
                TextColumn("{task.completed:,.0f}/{task.total:,.0f} steps"),
                TextColumn("{task.fields[rate]}"),
                TextColumn("{task.fields[measures]}"),
                TimeRemainingColumn(compact=True),
                console=self.console,
            )
            self._all = self.bar.add_task("", total=self._total, rate="", measures="")
            self.bar.start()
            self._draw()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the bars."""
        if self.bar is not None:
            self._draw()
            self.bar.stop()
            self.bar = None

    def member(self, run: RunDirectory) -> Member:
        """Who hears of the progress of a member."""
        self._members[run] = Member(self, self._labels[run], run.configuration.steps)
        return self._members[run]

    def settled(self, outcome: Outcome) -> None:
        """Count it if it is over, and say what is wrong with it."""
        self._settled += outcome.state != "interrupted"
        if (member := self._members.get(outcome.run)) is not None:
            member.settled(outcome)
        if outcome.state == "failed":
            self.say(f"{self._labels[outcome.run]}  failed: {outcome.text}")
        self._draw()

    def stopping(self) -> None:
        """Ask for patience."""
        self.say("Stopping as soon as the states can be saved; Ctrl-C again stops now.")

    def moved(self) -> None:
        """Some member has made steps."""
        if time.monotonic() - self._drawn > _PAUSE:
            self._draw()

    def say(self, text: str) -> None:
        """Print a line."""
        self.console.print(text, soft_wrap=True)
        self.console.file.flush()

    @property
    def _total(self) -> int:
        return sum(run.configuration.steps for run in self._runs)

    def _draw(self) -> None:
        """Draw the bar for all."""
        if self.bar is None or self._all is None:
            return
        self._drawn = time.monotonic()
        members = self._members.values()
        made = sum(member.step - member.first for member in members)
        rate = self._pace.rate(made) if made else 0.0
        pams = [member.pam for member in members if member.pam is not None]
        self.bar.update(
            self._all,
            description=f"{self._settled} of {len(self._runs)} runs",
            completed=sum(member.step for member in members),
            rate=f"{rate:,.0f}/s" if rate else "",
            measures=f"PAM {np.mean(pams):.2f}" if pams else "",
        )


class Member:
    """A listener of one training among others.

    Args:
        shared: What is printed for all of them.
        label: What tells it from the others.
        steps: Its steps in all.
    """

    def __init__(self, shared: PopulationProgress, label: str, steps: int) -> None:
        self._shared, self._label, self._steps = shared, label, steps
        self.first = self.step = 0
        """The step from which on it was trained now, and how far it is."""
        self.pam: float | None = None
        """PAM of its newest evaluation."""
        self._task: TaskID | None = None
        self._begun, self._drawn, self._pace = False, 0.0, Pace()

    def started(self, configuration: Configuration, step: int) -> None:
        """Open a bar, or say from where on it goes on."""
        self.first = self.step = step
        self._begun, self._pace = True, Pace()
        if self._shared.bar is not None:
            self._task = self._shared.bar.add_task(
                self._label,
                total=self._steps,
                completed=step,
                rate=beginning(configuration),
                measures="",
            )
        elif step:
            self._shared.say(f"{self._label}  from step {step:,}")

    def advanced(self, step: int) -> None:
        """Move the bars, ten times a second."""
        self.step = step
        rate, now = self._pace.rate(step), time.monotonic()
        if self._shared.bar is None or self._task is None or now - self._drawn <= _PAUSE:
            return
        self._drawn = now
        self._shared.bar.update(self._task, completed=step, rate=f"{rate:,.0f}/s" if rate else "")
        self._shared.moved()

    def evaluated(self, step: int, summary: Summary) -> None:
        """Show how good the policy is."""
        self.step, self.pam = step, summary.pam
        if self._shared.bar is not None and self._task is not None:
            self._shared.bar.update(self._task, completed=step, measures=describe(summary))
            self._shared.moved()
            return
        timing = pace(self._pace.rate(step), self._steps - step) if step > self.first else ""
        self._shared.say(f"{self._label}  step {step:>9,}  {describe(summary)}{timing}")

    def noticed(self, text: str) -> None:
        """Say it."""
        self._shared.say(f"{self._label}  {text}")

    def stopping(self) -> None:
        """Ask for patience."""
        self._shared.stopping()

    def ended(self) -> None:
        """Close the bar."""
        if self._shared.bar is not None and self._task is not None:
            self._shared.bar.remove_task(self._task)
        self._task = None

    def settled(self, outcome: Outcome) -> None:
        """Close what is open, of a training that could not say that it ended."""
        self.ended()
        if outcome.state == "complete" and not self._begun:
            # It was complete already.
            self.first = self.step = self._steps


def labels(configurations: Sequence[Configuration]) -> list[str]:
    """What tells each of some trainings from the others, in a few words."""
    described = [_described(configuration) for configuration in configurations]
    different = [i for i in range(len(described[0])) if len({row[i] for row in described}) > 1]
    found = [" ".join(row[i] for i in different if row[i]) for row in described]
    if len(set(found)) == len(found):
        return found
    return [f"{c.digest} {label}" for c, label in zip(configurations, found, strict=True)]


def _described(configuration: Configuration) -> tuple[str, ...]:
    shaped = configuration.reward in REWARDS and REWARDS[configuration.reward].shaped
    return (
        configuration.environment.rpartition("/")[2],
        configuration.reward,
        configuration.end if shaped else "",
        f"{configuration.trainer} {configuration.algorithm}",
        f"seed {configuration.seed}",
    )
