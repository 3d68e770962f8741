"""`hprs assess`: how well a recorded trace meets each requirement."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from hprs.cli.inputs import Constants, task_by_name

if TYPE_CHECKING:
    from hprs.semantics.assessment import Assessment
    from hprs.spec.task import Task


@dataclass(frozen=True)
class Assess:
    """Assess a recorded episode: PAM, and every requirement.

    The CSV file has a header of signal names (name[0], name[1] for a vector), and one row a state,
    s_0 first. Other columns are left out.

    Examples:
      hprs assess log.csv --task my_task.hprs
      hprs assess log.csv --task hprs/CartPole-v0 --json
    """

    trace: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="TRACE.csv")]
    """The recorded episode."""
    task: Annotated[str, tyro.conf.arg(metavar="FILE")]
    """Task file, or the id of a benchmark."""
    constants: Constants = ()
    json: bool = False
    """Print JSON instead of a table."""

    def run(self) -> int:
        """Assess the trace."""
        from hprs.cli.trace_file import read_trace
        from hprs.semantics.assessment import assess

        task = task_by_name(self.task, self.constants)
        found = assess(task, read_trace(self.trace, task))
        show = _print_json if self.json else _print
        show(self.trace, task, found)
        return 0


def _print_json(trace: Path, task: Task, found: Assessment) -> None:
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
        }
    )


def _print(trace: Path, task: Task, found: Assessment) -> None:
    from hprs.cli.console import plural, print_table

    rows = [
        (
            requirement.label,
            requirement.kind,
            f"{found.requirements[requirement.label]:.1%} of steps"
            if requirement.kind == "encourage"
            else ("met" if found.requirements[requirement.label] else "violated"),
        )
        for requirement in task.requirements
    ]
    title = f"{trace}: {plural(found.length, 'step')}, PAM {found.pam:.3f}"
    print_table(("requirement", "kind", "result"), rows, title=title, numbers_from=2)
    print()
    for word, holds in (("safe", found.safe), ("on target", found.target)):
        print(f"{word}: {'yes' if holds else 'no'}")
    print(f"comfort: {found.comfort:.3f}")
    for name, count in found.outside.items():
        print(
            f"Signal '{name}' left its range in {count:,} of {plural(found.length + 1, 'state')}."
        )
    if found.decided_at_start:
        print("The first state decided this episode already.")
