"""`hprs tasks`: the built-in benchmarks."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Tasks:
    """List the built-in benchmarks.

    Examples:
      hprs tasks
      hprs tasks --json
    """

    json: bool = False
    """Print JSON instead of a table."""

    def run(self) -> int:
        """List them."""
        from hprs.cli.console import print_json, print_table
        from hprs.envs.registration import BENCHMARKS

        content = []
        for benchmark in BENCHMARKS.values():
            content.append(
                {
                    "id": benchmark.id,
                    "description": benchmark.description,
                    "horizon": benchmark.horizon,
                    "requirements": list(benchmark.task.labels),
                }
            )
        if self.json:
            print_json(content)
            return 0
        print_table(
            ("benchmark", "what it asks", "horizon", "requirements"),
            [
                (row["id"], row["description"], str(row["horizon"]), ", ".join(row["requirements"]))
                for row in content
            ],
            numbers_from=4,
        )
        print("\nShow one: hprs check ID    Train on one: hprs train ID")
        return 0
