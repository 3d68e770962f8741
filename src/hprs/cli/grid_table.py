"""Shows a grid: its plan, and while it is trained a table of its runs.

On a terminal the table is live; elsewhere a line is printed for what has happened.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from types import TracebackType

from rich import box
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from hprs.cli.console import plural, print_table
from hprs.cli.population_progress import labels
from hprs.cli.progress import Pace, clock, describe, pace
from hprs.experiments.groups import reward_with_end
from hprs.experiments.plan import Estimate, Planned
from hprs.semantics.assessment import Summary
from hprs.training.configuration import Configuration
from hprs.training.population import Outcome
from hprs.training.run_directory import RunDirectory

_TIMES_A_SECOND = 4
_SELDOM = 30.0
"""Seconds between two lines about a run that trains, where there is no table."""
_SHOWN = 24
"""Runs in the live table, at most: those that train, then those that come next."""
_ORDER = ("training", "failed", "waiting", "interrupted", "done")


def print_plan(console: Console, planned: Sequence[Planned], cost: Estimate, side: str) -> None:
    """Print what is to be trained, a row for each environment, reward and algorithm.

    Args:
        console: Where to.
        planned: The trainings.
        cost: What the rest of them takes.
        side: How many are trained side by side, in words.
    """
    groups: dict[tuple[str, str, str], list[Planned]] = {}
    for entry in planned:
        found = entry.configuration
        key = found.environment, reward_with_end(found), f"{found.trainer} {found.algorithm}"
        groups.setdefault(key, []).append(entry)
    rows = [
        [
            *key,
            str(len(entries)),
            f"{entries[0].configuration.steps:,}",
            str(sum(entry.state == "done" for entry in entries)),
            str(sum(entry.state == "begun" for entry in entries)),
        ]
        for key, entries in groups.items()
    ]
    header = ["environment", "reward", "algorithm", "runs", "steps each", "done", "begun"]
    left = sum(entry.left for entry in planned)
    print_table(header, rows, numbers_from=3, title=f"{plural(len(planned), 'run')}")
    console.print()
    if not left:
        return
    console.print(f"{left:,} steps are left, {side}.", soft_wrap=True)
    console.print(
        f"Estimated: {_duration(cost.seconds)} of time, {cost.memory / 1000:.1f} GB of memory, "
        f"{_size(cost.disk)} on the disk; rates of another machine, a core a run.",
        soft_wrap=True,
    )
    if cost.unknown:
        console.print(f"Not in it, no rate known: {', '.join(cost.unknown)}.", soft_wrap=True)


class GridProgress:
    """An audience that shows all runs of a grid.

    Args:
        console: Where to.
        planned: The runs, those that are done among them.
    """

    def __init__(self, console: Console, planned: Sequence[Planned]) -> None:
        self.console = console
        named = labels([entry.configuration for entry in planned])
        self._rows = {
            # Where there is one run only, nothing tells it from others.
            entry.run: Row(self, name or f"seed {entry.configuration.seed}", entry)
            for name, entry in zip(named, planned, strict=True)
        }
        self._pace, self._before = Pace(), sum(row.step for row in self._rows.values())
        self.live: Live | None = None

    def __enter__(self) -> GridProgress:
        """Open the table."""
        if self.console.is_terminal:
            self.live = Live(
                get_renderable=self._draw,
                console=self.console,
                refresh_per_second=_TIMES_A_SECOND,
                transient=False,
            )
            self.live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave the table as it is."""
        if self.live is not None:
            self.live.stop()
            self.live = None

    def member(self, run: RunDirectory) -> Row:
        """Who hears of the progress of a run."""
        row = self._rows[run]
        row.state = "training"
        return row

    def settled(self, outcome: Outcome) -> None:
        """Note how a run has ended, and say it where there is no table."""
        row = self._rows[outcome.run]
        row.state = "done" if outcome.state == "complete" else outcome.state
        if outcome.state == "complete":
            row.step = row.total
        if outcome.state == "failed":
            self.say(f"{row.label}  failed: {outcome.text}")
        elif outcome.state == "complete" and self.live is None:
            self.say(f"{row.label}  done  {row.measures()}")
            self.say(f"{self._counted()}{self._timing()}")

    def stopping(self) -> None:
        """Ask for patience."""
        self.say("Stopping as soon as the states can be saved; Ctrl-C again stops now.")

    def say(self, text: str) -> None:
        """Print a line, above the table where there is one."""
        self.console.print(text, soft_wrap=True)
        self.console.file.flush()

    def _counted(self) -> str:
        states = [row.state for row in self._rows.values()]
        failed = f", {states.count('failed')} failed" if "failed" in states else ""
        return f"{states.count('done')} of {len(states)} runs done{failed}"

    def _timing(self) -> str:
        rows = self._rows.values()
        made = sum(row.step for row in rows) - self._before
        rate = self._pace.rate(made) if made else 0.0
        return pace(rate, sum(row.total - row.step for row in rows if row.state != "failed"))

    def _draw(self) -> Group:
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
        for name, side in (("run", "left"), ("state", "left"), ("steps", "right"),
                           ("PAM", "right"), ("S", "right"), ("S+T", "right"),
                           ("steps/s", "right"), ("left", "right")):  # fmt: skip
            table.add_column(name, justify="left" if side == "left" else "right", no_wrap=True)
        rows = sorted(self._rows.values(), key=lambda row: _ORDER.index(row.state))
        for row in rows[:_SHOWN]:
            table.add_row(*(Text(cell) for cell in row.cells()))
        hidden = len(rows) - _SHOWN
        more = f"  ({plural(hidden, 'run')} not shown)" if hidden > 0 else ""
        return Group(table, Text(f"{self._counted()}{self._timing()}{more}"))


class Row:
    """A listener of one run of a grid.

    Args:
        shared: The table that it is of.
        label: What tells it from the others.
        planned: The run.
    """

    def __init__(self, shared: GridProgress, label: str, planned: Planned) -> None:
        self._shared, self.label = shared, label
        self.total = planned.configuration.steps
        done = planned.state == "done"
        self.state, self.step = "done" if done else "waiting", planned.step
        if done:
            self.step = self.total
        self._summary: Summary | None = None
        self._pace, self._rate = Pace(), 0.0
        self._said = float("-inf")

    def started(self, configuration: Configuration, step: int) -> None:
        """Begin to measure how fast it is, and say that it trains."""
        self.step, self._pace, self._said = step, Pace(), time.monotonic()
        if self._shared.live is None:
            self._shared.say(f"{self.label}  from step {step:,} of {self.total:,}")

    def advanced(self, step: int) -> None:
        """Note how far it is."""
        self.step, self._rate = step, self._pace.rate(step)

    def evaluated(self, step: int, summary: Summary) -> None:
        """Note how good it is; where there is no table, say it."""
        self.step, self._summary = step, summary
        if self._shared.live is None and time.monotonic() - self._said > _SELDOM:
            self._said = time.monotonic()
            timing = pace(self._pace.rate(step), self.total - step)
            self._shared.say(f"{self.label}  step {step:>9,}  {describe(summary)}{timing}")

    def noticed(self, text: str) -> None:
        """Say it."""
        self._shared.say(f"{self.label}  {text}")

    def stopping(self) -> None:
        """Ask for patience."""
        self._shared.stopping()

    def ended(self) -> None:
        """Nothing: the outcome says how."""

    def measures(self) -> str:
        """How good its policy is, as of its newest evaluation."""
        return "" if self._summary is None else describe(self._summary)

    def cells(self) -> list[str]:
        """Its row of the live table."""
        found = self._summary
        measures = (
            ["", "", ""]
            if found is None
            else [f"{value:.2f}" for value in (found.pam, found.safe, found.safe_target)]
        )
        busy = self.state == "training" and self._rate > 0.0
        speed = [f"{self._rate:,.0f}", clock((self.total - self.step) / self._rate)] if busy else []
        share = f"{self.step:,} of {self.total:,}"
        return [self.label, self.state, share, *measures, *(speed or ["", ""])]


def _duration(seconds: float) -> str:
    days = seconds / 86_400
    return f"{days:.1f} days" if days >= 2 else clock(seconds)


def _size(megabytes: float) -> str:
    return f"{megabytes / 1000:.1f} GB" if megabytes >= 1000 else f"{megabytes:.0f} MB"
