"""`hprs check`: parse and analyse a task."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import tyro

from hprs.cli.inputs import Constants, task_by_name

if TYPE_CHECKING:
    from hprs.spec.task import Task


@dataclass(frozen=True)
class Check:
    """Parse and analyse a task; print its requirements with bounds and order.

    Exit code 1 and a caret below the place if the task is wrong. Remarks are no errors.

    Examples:
      hprs check my_task.hprs
      hprs check hprs/CartPole-v0          a benchmark's own task
      hprs check my_task.hprs --const mark=-1
      hprs check my_task.hprs --json
    """

    task: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="TASK")]
    """Task file, or the id of a benchmark."""
    constants: Constants = ()
    json: bool = False
    """Print JSON instead of a table."""

    def run(self) -> int:
        """Check the task."""
        from hprs.cli.console import print_json

        task = task_by_name(self.task, self.constants)
        if self.json:
            print_json(_content(task))
        else:
            _print(task)
        _warn(task, self.task)
        return 0


def _content(task: Task) -> dict[str, object]:
    from hprs.spec.printer import format_predicate

    return {
        "requirements": [
            {
                "label": requirement.label,
                "kind": requirement.kind,
                "predicate": format_predicate(requirement.predicate),
                "low": task.bounds[requirement.label][0],
                "high": task.bounds[requirement.label][1],
                "ranks_below": _above(task, requirement.label),
            }
            for requirement in task.requirements
        ],
        "remarks": [
            {"message": remark.message, "line": remark.position.line if remark.position else None}
            for remark in task.remarks
        ],
    }


def _print(task: Task) -> None:
    from hprs.cli.console import print_table
    from hprs.spec.printer import format_predicate

    rows = [
        (
            requirement.label,
            requirement.kind,
            format_predicate(requirement.predicate),
            "[{:.4g}, {:.4g}]".format(*task.bounds[requirement.label]),
            ", ".join(_above(task, requirement.label)) or "-",
        )
        for requirement in task.requirements
    ]
    header = ("requirement", "kind", "holds where", "margin lies in", "ranks below")
    print_table(header, rows, numbers_from=len(header))


def _above(task: Task, label: str) -> list[str]:
    return [other for other in task.labels if other in task.order.above[label]]


def _warn(task: Task, name: str) -> None:
    import sys

    for remark in task.remarks:
        line = f":{remark.position.line}" if remark.position else ""
        print(f"{name}{line}: warning: {remark.message}", file=sys.stderr)
