"""`hprs benchmark`: train a grid of runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from hprs.errors import UsageError

if TYPE_CHECKING:
    from rich.console import Console

    from hprs.cli.grid_table import GridProgress
    from hprs.experiments.plan import Planned
    from hprs.training.population import Outcome
    from hprs.training.run_directory import RunDirectory


@dataclass(frozen=True)
class Benchmark:
    """Train every combination that a grid's file asks for.

    What is trained already is skipped, what was interrupted goes on, and what fails is reported and
    does not stop the rest. Ctrl-C saves all states; the same command goes on. A run is found again
    by the hash of its configuration, whoever has trained it.

    Examples:
      hprs benchmark examples/grids/quick.toml --dry-run
      hprs benchmark examples/grids/quick.toml
      hprs benchmark my_grid.toml --workers 8 --out /data/runs
      hprs benchmark my_grid.toml --ray auto --out /shared/runs
    """

    grid: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="GRID.toml")]
    """The grid."""
    dry_run: bool = False
    """Train nothing: print what would be trained, and what it would take."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("runs")
    """Where run directories are made, and looked for."""
    workers: Annotated[
        int | None,
        tyro.conf.arg(
            metavar="N",
            help_behavior_hint="",
            help="Runs that are trained side by side, each in a process of its own; 0: those that "
            "make one program at once. Default: one a core, on a GPU 0; with --ray as many as the "
            "cluster has room for.",
        ),
    ] = None
    ray: Annotated[
        str | None,
        tyro.conf.arg(
            metavar="ADDRESS",
            help_behavior_hint="",
            help="Train over the nodes of a Ray cluster: auto, HOST:6379, ray://HOST:10001, or "
            "local for one that is started here. All nodes must share the folder of --out.",
        ),
    ] = None

    def run(self) -> int:
        """Train the grid."""
        from hprs.cli.console import console
        from hprs.cli.grid_table import print_plan
        from hprs.cli.training import default_workers
        from hprs.experiments.grid import configurations_of, read_grid
        from hprs.experiments.plan import estimate, plan

        if self.workers is not None and self.workers < 0:
            raise UsageError(f"--workers takes a number from 0 on, got {self.workers}.")
        configurations = configurations_of(read_grid(self.grid))
        planned = plan(configurations, self.out)
        workers, out = self.workers, console()
        if workers is None:
            # How much room a cluster has is seen only when it is there.
            workers = default_workers(configurations) if self.ray is None else 1
        print_plan(out, planned, estimate(planned, workers), self._side(workers))
        if self.dry_run:
            return 0
        return self._train(planned, out, workers)

    def _side(self, workers: int) -> str:
        if workers == 0:
            return "all members of a program at once"
        if self.ray is not None and self.workers is None:
            return "side by side as the cluster has room, estimated one after the other"
        return f"{workers} side by side"

    def _train(self, planned: Sequence[Planned], out: Console, workers: int) -> int:
        from hprs.cli.grid_table import GridProgress
        from hprs.experiments.plan import prepare

        runs = prepare(planned, self.out)
        if not runs:
            out.print(f"All {len(planned)} runs are done. Show them with: hprs report {self.out}")
            return 0
        with GridProgress(out, planned) as progress:
            outcomes = self._executed(runs, progress, workers)
        failed = [outcome for outcome in outcomes if outcome.state == "failed"]
        for outcome in failed:
            out.print(f"Failed: {outcome.run.path}: {outcome.text}", soft_wrap=True)
        if any(outcome.state == "interrupted" for outcome in outcomes):
            out.print(f"Stopped. The same command goes on: hprs benchmark {self.grid}")
            return 130
        complete = len(planned) - len(failed)
        out.print(f"{complete} of {len(planned)} runs are done, in {self.out}.", soft_wrap=True)
        if complete:
            out.print(f"Show them with: hprs report {self.out}", soft_wrap=True)
        return 1 if failed else 0

    def _executed(
        self, runs: Sequence[RunDirectory], audience: GridProgress, workers: int
    ) -> list[Outcome]:
        if self.ray is not None:
            from hprs.experiments.ray_executor import train_on_ray

            return train_on_ray(runs, audience, address=self.ray, workers=self.workers)
        from hprs.training.population import train_population

        return train_population(runs, audience, workers=min(workers, len(runs)))
