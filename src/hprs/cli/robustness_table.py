"""The table that `hprs robustness` prints."""

from __future__ import annotations

from collections.abc import Sequence

from hprs.cli.console import print_table
from hprs.experiments.robustness_result import SHOWN, Row


def print_rows(rows: Sequence[Row]) -> None:
    """Print a row a point, with the measures of all policies beside each other."""
    policies = list(dict.fromkeys(row.policy for row in rows))
    by_point: dict[tuple[str, str], dict[str, Row]] = {}
    for row in rows:
        by_point.setdefault((row.perturbation, row.value), {})[row.policy] = row
    letters = "AB" if len(policies) > 1 else " "
    for letter, policy in zip(letters, policies, strict=True):
        print(f"{letter}  {policy}".strip())
    header = ["", "value", "trained"]
    header += [f"{name} {letter}".strip() for letter in letters for name in SHOWN]
    cells: list[list[str]] = []
    breaks: list[int] = []
    last = ""
    for (perturbation, value), found in by_point.items():
        if cells and perturbation != last:
            breaks.append(len(cells) - 1)
        row = next(iter(found.values()))
        unit = f" {row.unit}" if row.unit not in ("", "1") else ""
        marks = [
            letter
            for letter, policy in zip(letters, policies, strict=True)
            if policy in found and found[policy].trained
        ]
        trained = " ".join(marks) if len(policies) > 1 else "yes" if marks else ""
        shown = [
            f"{found[policy].measures[name].value:.2f}" if policy in found else "-"
            for policy in policies
            for name in SHOWN
        ]
        name = perturbation if perturbation != last else ""
        cells.append([name, f"{value}{unit}", trained, *shown])
        last = perturbation
    print_table(header, cells, numbers_from=3, breaks=breaks)
    episodes = rows[0].episodes
    print()
    print("S safe, S+T safe and on target, S+T+C mean comfort of those (0 for the others).")
    print(f"{episodes} episodes a point, the same seeds everywhere; 95 % intervals: in the CSV.")
    print("trained: the value is one of the training's, for which the policy was prepared.")
