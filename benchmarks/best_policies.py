"""Puts the best policy of every benchmark where it is easily found: results/policies.

    .venv/bin/python benchmarks/best_policies.py
    .venv/bin/hprs evaluate results/policies/safe-driving

The best is, of the policies whose bundles the studies have kept, the one with the highest S+T, then
the highest S+T+C, over the 50 episodes of results/ALGORITHM/ENVIRONMENT/policies.csv. Its folder
says which one it is. Bundles that were written before they said where they were trained are told.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hprs.deploy import load_bundle
from hprs.deploy.archive import save_bundle
from hprs.training.configuration import Configuration
from hprs.training.session import POLICY

RESULTS = Path(__file__).parent.parent / "results"
MEASURES = ("S", "S+T", "S+T+C", "PAM")


@dataclass(frozen=True)
class Candidate:
    """A policy that a study has kept."""

    bundle: Path
    row: dict[str, str]
    """Of the study's table."""
    configuration: dict[str, Any]

    @property
    def benchmark(self) -> str:
        """Its benchmark as a folder's name: `safe-driving` of `hprs/SafeDriving-v0`."""
        name = self.configuration["environment"].partition("/")[2].rpartition("-")[0]
        words = "".join(f"-{letter.lower()}" if letter.isupper() else letter for letter in name)
        return words.lstrip("-")

    @property
    def rank(self) -> tuple[float, float]:
        """What decides."""
        return float(self.row["S+T"]), float(self.row["S+T+C"])


def candidates() -> Iterator[Candidate]:
    """All policies that the studies have kept."""
    for table in sorted(RESULTS.glob("*/*/policies.csv")):
        with table.open(newline="") as stream:
            rows = list(csv.DictReader(stream))
        for row in rows:
            name = row["condition"].replace(" ", "-")
            bundle = table.parent / f"{name}-seed-{row['seed']}.bundle"
            if bundle.exists():
                text = (table.parent / "configurations" / f"{name}.json").read_text()
                yield Candidate(bundle, row, json.loads(text))


def keep(best: Candidate) -> None:
    """Write a policy's folder."""
    folder = RESULTS / "policies" / best.benchmark
    folder.mkdir(parents=True, exist_ok=True)
    bundle = load_bundle(best.bundle)
    configuration = Configuration.from_json({**best.configuration, "seed": int(best.row["seed"])})
    bundle = replace(bundle, provenance={**configuration.home, **bundle.provenance})
    bundle.self_check()
    save_bundle(bundle, folder / POLICY)
    content = {
        "from": best.bundle.relative_to(RESULTS).as_posix(),
        "condition": best.row["condition"],
        "seed": configuration.seed,
        "steps": configuration.steps,
        **{measure: float(best.row[measure]) for measure in MEASURES},
    }
    (folder / "chosen.json").write_text(json.dumps(content, indent=1) + "\n")
    print(f"{best.benchmark}: {content['from']}, S+T {content['S+T']}, S+T+C {content['S+T+C']}")


def main() -> None:
    """Choose and write."""
    found: dict[str, Candidate] = {}
    for candidate in candidates():
        other = found.get(candidate.benchmark)
        if other is None or candidate.rank > other.rank:
            found[candidate.benchmark] = candidate
    for best in found.values():
        keep(best)


if __name__ == "__main__":
    main()
