"""`hprs assess`: how well a recorded trace meets each requirement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from hprs.cli.inputs import Constants, task_by_name
from hprs.semantics.trace import Missing

if TYPE_CHECKING:
    from hprs.semantics.assessment import Assessment
    from hprs.spec.task import Task


@dataclass(frozen=True)
class Assess:
    """Assess a recorded episode: PAM, and every requirement.

    A CSV or Parquet file has columns named as signals (name[0], name[1] for a vector), and one row
    a state at the policy's rate, s_0 first. Other columns are left out. A column time, timestamp,
    stamp or t must increase from row to row. In a rosbag (ROS 1, ROS 2) states are taken at the
    messages of one topic; docs/interop.md has the details.

    Examples:
      hprs assess log.csv --task my_task.hprs
      hprs assess log.csv --task hprs/CartPole-v0 --json
      hprs assess log.parquet --task my_task.hprs --column v=speed --missing unknown
      hprs assess drive.bag --task my_task.hprs --ticks /drive --column v=/odom.twist.twist.linear.x
    """

    trace: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="TRACE")]
    """The recorded episode: .csv, .parquet, .bag, .mcap, or the folder of a rosbag of ROS 2."""
    task: Annotated[str, tyro.conf.arg(metavar="FILE")]
    """Task file, or the id of a benchmark."""
    constants: Constants = ()
    columns: Annotated[
        tyro.conf.UseAppendAction[tuple[str, ...]],
        tyro.conf.arg(name="column", metavar="SIGNAL=COLUMN"),
    ] = ()
    """The column of a signal, where its name is another one; of a rosbag, TOPIC.FIELD."""
    missing: Missing = "error"
    """What to make of signals that the log lacks, wholly or in some rows: an error, or unknown
    requirements."""
    time: Annotated[str | None, tyro.conf.arg(metavar="COLUMN", help_behavior_hint="")] = None
    """The column of time stamps; "" if there is none."""
    ticks: Annotated[str | None, tyro.conf.arg(metavar="TOPIC", help_behavior_hint="")] = None
    """The topic of a rosbag whose messages are the policy's ticks, as its commands."""
    json: bool = False
    """Print JSON instead of a table."""

    def run(self) -> int:
        """Assess the trace."""
        from hprs.cli.trace_columns import Wanted, parse_columns
        from hprs.cli.trace_file import open_trace
        from hprs.semantics.chunks import assess_chunks

        task = task_by_name(self.task, self.constants)
        wanted = Wanted(
            task,
            missing=self.missing,
            columns=parse_columns(self.columns),
            time=self.time,
            ticks=self.ticks,
            advice=" With --missing unknown the requirements that need it are unknown.",
            unused=False,
        )
        recording = open_trace(self.trace, wanted)
        found = assess_chunks(task, recording.chunks, missing=self.missing)
        show = _print_json if self.json else _print
        show(self.trace, task, found, recording.notes)
        return 0


def _print_json(trace: Path, task: Task, found: Assessment, notes: Sequence[str]) -> None:
    from hprs.cli.console import print_json

    print_json(
        {
            "trace": str(trace),
            "steps": found.length,
            "pam": found.pam,
            "safe": found.safe,
            "target": found.target,
            "satisfied": found.satisfied,
            "comfort": found.comfort,
            "requirements": dict(found.requirements),
            "outside_ranges": dict(found.outside),
            "decided_at_start": found.decided_at_start,
            **({"unknown": list(found.unknown)} if found.unknown else {}),
            **({"notes": list(notes)} if notes else {}),
        }
    )


def _print(trace: Path, task: Task, found: Assessment, notes: Sequence[str]) -> None:
    from hprs.cli.console import plural, print_table

    rows = [
        (r.label, r.kind, _result(r.kind, found.requirements[r.label])) for r in task.requirements
    ]
    title = f"{trace}: {plural(found.length, 'step')}, PAM {_number(found.pam)}"
    print_table(("requirement", "kind", "result"), rows, title=title, numbers_from=2)
    print()
    for word, holds in (("safe", found.safe), ("on target", found.target)):
        print(f"{word}: {_UNKNOWN if holds is None else 'yes' if holds else 'no'}")
    print(f"comfort: {_number(found.comfort)}")
    if found.unknown:
        print(f"The log does not say whether {', '.join(found.unknown)} is met.")
    for name, count in found.outside.items():
        print(
            f"Signal '{name}' left its range in {count:,} of {plural(found.length + 1, 'state')}."
        )
    if found.decided_at_start:
        print("The first state decided this episode already.")
    for note in notes:
        print(note)


_UNKNOWN = "unknown"


def _result(kind: str, found: Any) -> str:
    if found is None:
        return _UNKNOWN
    if kind == "encourage":
        return f"{found:.1%} of steps"
    return "met" if found else "violated"


def _number(value: float | None) -> str:
    return _UNKNOWN if value is None else f"{value:.3f}"
