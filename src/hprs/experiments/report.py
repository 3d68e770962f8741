"""A report: the tables and curves of every benchmark, as files and as one page."""

from __future__ import annotations

import base64
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files as resources
from pathlib import Path
from typing import Any

import numpy as np

from hprs.experiments import curves, table_formats, tables
from hprs.experiments.groups import Benchmark, Group
from hprs.experiments.offline import Means
from hprs.experiments.recorded import Recorded
from hprs.experiments.statistics import FAILED
from hprs.experiments.tables import Table
from hprs.training import files
from hprs.training.page_data import filled
from hprs.training.provenance import PACKAGES

PAGE = "report.html"


@dataclass(frozen=True)
class Picture:
    """A picture in the page."""

    caption: str
    kind: str
    """As in `image/webp`."""
    data: bytes
    moves: bool
    """Whether it is a film."""


@dataclass(frozen=True, eq=False)
class Section:
    """What a report says of a benchmark."""

    benchmark: Benchmark
    found: Mapping[Group, Sequence[Means]]
    """Of each group the means of its seeds' last policies."""
    floors: Mapping[str, Means]
    """Of policies that know nothing."""
    episodes: int
    """That the means are over."""
    pictures: Sequence[Picture] = ()

    def tables(self, *, paper: bool) -> list[Table]:
        """Its tables; with the published numbers, if they are asked for and there are any."""
        benchmark, found, floors = self.benchmark, self.found, self.floors
        made = [
            tables.offline_table(benchmark, found, floors, self.episodes),
            tables.comparison_table(benchmark, found, floors) if paper else None,
            tables.requirement_table(benchmark, found, floors),
            tables.ablation_table(benchmark, found, floors, paper=paper),
            tables.improvement_table(benchmark, found, floors),
            tables.cost_table(benchmark),
        ]
        return [table for table in made if table is not None]


def recorded_means(benchmark: Benchmark) -> dict[Group, Sequence[Means]]:
    """The means of the last policies, as the training's last evaluation has found them."""
    return {group: [run.newest for run in group.runs] for group in benchmark.groups}


def best_run(section: Section) -> Recorded:
    """The run whose last policy has the highest S+T+C, then PAM."""
    ranked = [
        (means["S+T+C"], means["PAM"], -place, run)
        for group, seeds in section.found.items()
        for place, (means, run) in enumerate(zip(seeds, group.runs, strict=True))
    ]
    return max(ranked, key=lambda entry: entry[:3])[3]


def warnings_of(recorded: Sequence[Recorded]) -> Iterator[str]:
    """What whoever reads the report should know of the runs."""
    unfinished = [run for run in recorded if not run.is_complete]
    if unfinished:
        yield (
            f"{len(unfinished)} of {len(recorded)} runs are not trained to their end, such as "
            f"{unfinished[0].run.path}; their newest evaluation counts, and curves end with the "
            "shortest run."
        )
    for package in PACKAGES:
        found = Counter(run.versions[package] for run in recorded if package in run.versions)
        if len(found) > 1:
            shown = ", ".join(f"{count} with {version}" for version, count in found.most_common())
            yield f"Mixed versions of {package}: {shown}. Numbers may differ for this reason alone."


def write_report(
    sections: Sequence[Section],
    out: Path,
    *,
    title: str,
    warnings: Sequence[str] = (),
    paper: bool = False,
) -> Path:
    """Write everything into a folder.

    Args:
        sections: The benchmarks.
        out: The folder.
        title: Of the page.
        warnings: What is said at its top.
        paper: Whether the published numbers are set beside.

    Returns:
        The page.

    Raises:
        RunError: It cannot be written.
    """
    with files.writing(out):
        out.mkdir(parents=True, exist_ok=True)
    content: list[dict[str, Any]] = []
    for section in sections:
        benchmark = section.benchmark
        made = section.tables(paper=paper)
        base = slug(benchmark.name)
        for table in made:
            _write(out / f"{base}-{table.name}.csv", table_formats.to_csv(table).encode())
            _write(out / f"{base}-{table.name}.tex", table_formats.to_latex(table).encode())
        for over in ("steps", "seconds"):
            if over == "steps" or not _untimed(benchmark):
                for suffix, data in curves.draw(benchmark, over).items():
                    _write(out / f"{base}-{over}{suffix}", data)
        content.append(
            {
                "name": benchmark.name,
                "curves": curves.to_page(benchmark),
                "tables": [table_formats.to_page(table) for table in made],
                "pictures": [_picture(picture) for picture in section.pictures],
            }
        )
    runs = sum(len(group.runs) for section in sections for group in section.benchmark.groups)
    data = {
        "title": title,
        "summary": f"{runs} runs on {len(sections)} benchmark{'s' * (len(sections) > 1)}.",
        "warnings": list(warnings),
        "failed": FAILED,
        "views": {name: view.to_page() for name, view in curves.VIEWS.items()},
        "benchmarks": content,
        "footer": "Beside this page are its tables as CSV and LaTeX, its curves as PNG and SVG.",
    }
    template = resources("hprs.experiments").joinpath("report.html").read_text(encoding="utf-8")
    _write(out / PAGE, filled(template, title, data).encode())
    return out / PAGE


def slug(name: str) -> str:
    """A benchmark's name as the begin of files' names."""
    return re.sub(r"[^A-Za-z0-9]+", "-", name.rpartition("/")[2]).strip("-").lower()


def _untimed(benchmark: Benchmark) -> bool:
    return any(np.isnan(group.seconds).any() for group in benchmark.groups)


def _picture(picture: Picture) -> dict[str, Any]:
    coded = base64.b64encode(picture.data).decode("ascii")
    return {
        "caption": picture.caption,
        "source": f"data:image/{picture.kind};base64,{coded}",
        "moves": picture.moves,
    }


def _write(path: Path, data: bytes) -> None:
    with files.writing(path):
        files.replace(path, data)
