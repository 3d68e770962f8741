"""`hprs report`: learning curves, tables and one page of many runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from hprs.errors import UsageError, did_you_mean

if TYPE_CHECKING:
    from hprs.experiments.groups import Benchmark
    from hprs.experiments.recorded import Recorded
    from hprs.experiments.report import Section

_PAPER = "paper"
_ASSESSMENTS, _SHELF, _PICTURES = "assessments.json", "recorded.npz", "pictures"
_CACHE = ".cache"
"""In the report's folder: what need not be found out again."""


@dataclass(frozen=True)
class Report:
    """Show many runs: learning curves, the paper's tables, and one page to read.

    Takes all runs below a folder, whoever trained them. Runs that differ in their seed alone are
    one line. The page needs no network; beside it are the tables as CSV and LaTeX, and the curves
    as PNG and SVG. What was read, assessed and filmed is kept in DIR/.cache, so that the next
    report takes seconds.

    Examples:
      hprs report runs
      hprs report runs/hprs-SafeDriving-v0 --out driving
      hprs report runs --compare paper --episodes 50
    """

    runs: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="RUNS")]
    """A folder with runs, however deep."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("report")
    """Where the report goes; files of the same names are replaced."""
    compare: Annotated[str | None, tyro.conf.arg(metavar="paper", help_behavior_hint="")] = None
    """Set the published numbers beside."""
    episodes: Annotated[
        int | None,
        tyro.conf.arg(
            metavar="N",
            help_behavior_hint="",
            help="Assess every last policy over N fresh episodes; default: take the training's "
            "last evaluation.",
        ),
    ] = None
    no_pictures: bool = False
    """Play and film no episode of the best policies."""
    title: str = "Training report"
    """Of the page."""

    def run(self) -> int:
        """Write the report."""
        from hprs.cli.console import console
        from hprs.experiments.groups import benchmarks
        from hprs.experiments.report import warnings_of, write_report
        from hprs.training.environment import require

        for package in ("matplotlib", "PIL", "scipy"):
            require(package, "report")
        self._check()
        recorded, warnings = self._read()
        warnings += warnings_of(recorded)
        sections = self._sections(benchmarks(recorded), warnings)
        page = write_report(
            sections, self.out, title=self.title, warnings=warnings, paper=self.compare == _PAPER
        )
        out = console()
        self._print(sections)
        for text in warnings:
            out.print(text, soft_wrap=True)
        out.print(f"Written: {page}", soft_wrap=True)
        return 0

    def _check(self) -> None:
        if self.compare not in (None, _PAPER):
            raise UsageError(
                f"--compare takes {_PAPER}, not '{self.compare}'."
                f"{did_you_mean(str(self.compare), [_PAPER])}"
            )
        if self.episodes is not None and self.episodes < 1:
            raise UsageError(f"--episodes must be at least 1, got {self.episodes}.")
        if self.out.exists() and not self.out.is_dir():
            raise UsageError(f"--out is a folder; '{self.out}' is a file.")

    def _read(self) -> tuple[list[Recorded], list[str]]:
        from hprs.cli.console import console
        from hprs.errors import RunError
        from hprs.experiments.recorded import Shelf, find_below, read_all

        runs = find_below(self.runs)
        (self.out / _CACHE).mkdir(parents=True, exist_ok=True)
        shelf = Shelf(self.out / _CACHE / _SHELF)
        screen = console(stderr=True)
        with _bar(screen, "reading runs") as bar:
            task = bar.add_task("", total=len(runs))
            found = read_all(runs, shelf, lambda count: bar.update(task, completed=count))
        shelf.save()
        if not found[0]:
            raise RunError(f"'{self.runs}' holds no run with results. {found[1][0]}")
        return found

    def _sections(self, found: Sequence[Benchmark], warnings: list[str]) -> list[Section]:
        from hprs.cli.console import console
        from hprs.cli.progress import EvaluationProgress
        from hprs.experiments.offline import Assessments

        policies = sum(len(group.runs) for one in found for group in one.groups)
        count = 2 * len(found) + (policies if self.episodes else 0)
        each = self.episodes or _RECORDED
        with EvaluationProgress(console(stderr=True), policies=count, episodes=each) as progress:
            assessments = Assessments(self.out / _CACHE / _ASSESSMENTS, each, progress.watcher)
            sections = [self._section(one, assessments, warnings) for one in found]
        return [self._with_pictures(section, warnings) for section in sections]

    def _section(self, benchmark: Benchmark, assessments: Any, warnings: list[str]) -> Section:
        from hprs.errors import HprsError
        from hprs.experiments.report import Section, recorded_means

        if self.episodes:
            found = {
                group: [assessments.of_run(run.run) for run in group.runs]
                for group in benchmark.groups
            }
            episodes = self.episodes
        else:
            found = recorded_means(benchmark)
            episodes = min(run.episodes for group in benchmark.groups for run in group.runs)
        try:
            floors = assessments.floors(benchmark)
        # The environment of somebody else's runs need not be here.
        except HprsError as error:
            floors = {}
            warnings.append(f"No floors for {benchmark.name}: {error}")
        return Section(benchmark, found, floors, episodes)

    def _with_pictures(self, section: Section, warnings: list[str]) -> Section:
        from dataclasses import replace

        from hprs.cli.report_pictures import pictures_of
        from hprs.errors import HprsError
        from hprs.experiments.report import best_run

        if self.no_pictures:
            return section
        run = best_run(section)
        label = next(group.label for group in section.benchmark.groups if run in group.runs)
        try:
            pictures = pictures_of(run, label, self.out / _CACHE / _PICTURES)
        except HprsError as error:
            warnings.append(f"No pictures of {section.benchmark.name}: {error}")
            return section
        return replace(section, pictures=pictures)

    def _print(self, sections: Sequence[Section]) -> None:
        from hprs.cli.console import console, print_table

        for section in sections:
            table, *_ = section.tables(paper=False)
            rows = [[cell.text for cell in row] for row in table.rows]
            title = f"{section.benchmark.name}: {section.episodes} episodes a policy"
            print_table(list(table.header), rows, numbers_from=1, title=title)
            console().print()


_RECORDED = 20
"""Episodes of the floors, where the policies are not assessed anew."""


def _bar(screen: Any, text: str) -> Any:
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (TextColumn(text), BarColumn(), MofNCompleteColumn())
    return Progress(*columns, console=screen, disable=not screen.is_terminal, transient=True)
