"""`hprs explain`: which requirement earned or cost what, step by step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from hprs.cli.inputs import Constants, task_by_name
from hprs.errors import UsageError

if TYPE_CHECKING:
    from hprs.explanation.explanation import Explanation
    from hprs.explanation.film import Film

_OF_RUNS = {"which": "which", "seed": "seed", "options": "env", "horizon": "horizon"}
_OF_TRACES = {"columns": "column", "time": "time", "ticks": "ticks"}
"""Fields that only a run or only a trace has a use for, and their options."""


@dataclass(frozen=True)
class Explain:
    """Explain an episode: which requirement earned or cost what, step by step.

    Of a run, the policy plays an episode; of a trace, the recorded one is taken. Prints a table,
    and writes a picture and an HTML page to scrub through; files of these names are replaced.

    Examples:
      hprs explain runs/hprs-CartPole-v0/hprs-ppo-1a2b3c4d/seed-0
      hprs explain runs/hprs-CartPole-v0/hprs-ppo-1a2b3c4d/seed-0 --which best --seed 7 --out parked
      hprs explain log.csv --task my_task.hprs --rate 50
      hprs explain drive.bag --task my_task.hprs --ticks /drive --rate 10
    """

    subject: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="RUN|TRACE")]
    """Run directory, or a recorded episode as `hprs assess` reads it."""
    out: Annotated[Path, tyro.conf.arg(metavar="NAME")] = Path("explanation")
    """What is written: NAME.png and NAME.html."""
    task: Annotated[str | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """Task file, or the id of a benchmark; default: the run's own task."""
    constants: Constants = ()
    rate: Annotated[float | None, tyro.conf.arg(metavar="HZ", help_behavior_hint="")] = None
    """Steps a second; default: as a run's environment states it."""
    which: str = "last"
    """The policy of a run: last, or best (by PAM)."""
    seed: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Seed of a run's episode; default: the first one that `hprs evaluate` takes."""
    options: Annotated[
        tyro.conf.UseAppendAction[tuple[str, ...]],
        tyro.conf.arg(name="env", metavar="KEY=VALUE"),
    ] = ()
    """An option of a run's environment, as its constructor names it; default: as trained."""
    horizon: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """End a run's episode after this many steps; default: as trained, or as registered."""
    columns: Annotated[
        tyro.conf.UseAppendAction[tuple[str, ...]],
        tyro.conf.arg(name="column", metavar="SIGNAL=COLUMN"),
    ] = ()
    """The column of a trace's signal, as `hprs assess` takes it."""
    time: Annotated[str | None, tyro.conf.arg(metavar="COLUMN", help_behavior_hint="")] = None
    """The column of a trace's time stamps, which must increase; "" if there is none."""
    ticks: Annotated[str | None, tyro.conf.arg(metavar="TOPIC", help_behavior_hint="")] = None
    """The topic of a rosbag whose messages are the policy's ticks."""
    json: bool = False
    """Print JSON instead of a table."""

    def run(self) -> int:
        """Explain the episode."""
        from hprs.cli.explanation_table import print_explanation, print_explanation_json
        from hprs.explanation.figure import draw
        from hprs.explanation.page import page
        from hprs.training import files
        from hprs.training.environment import require

        for package in ("matplotlib", "PIL"):
            require(package, "report")
        base = self._base()
        if self.rate is not None and not 0.0 < self.rate < float("inf"):
            raise UsageError(f"--rate must be positive, got {self.rate:g}.")
        found, film = self._trace() if self._is_trace else self._run()
        written = [base.with_name(f"{base.name}{suffix}") for suffix in (".png", ".html")]
        for path, data in zip(written, (draw(found, film), page(found, film)), strict=True):
            with files.writing(path):
                files.replace(path, data if isinstance(data, bytes) else data.encode())
        show = print_explanation_json if self.json else print_explanation
        show(found, film, written)
        return 0

    @property
    def _is_trace(self) -> bool:
        from hprs.cli.trace_file import is_bag

        path = self.subject
        return path.is_file() or is_bag(path) or (bool(path.suffix) and not path.exists())

    def _refuse(self, unfit: Mapping[str, str], *, fit: str, found: str) -> None:
        default = {field.name: field.default for field in fields(self)}
        for name, option in unfit.items():
            if getattr(self, name) != default[name]:
                raise UsageError(f"--{option} is for a {fit}; '{self.subject}' is a {found}.")

    def _base(self) -> Path:
        base = self.out.with_suffix("") if self.out.suffix in (".png", ".html") else self.out
        if not base.name or base.is_dir():
            raise UsageError(
                f"--out is a file's name without its ending; '{self.out}' is a folder."
            )
        if not base.parent.is_dir():
            raise UsageError(f"there is no folder '{base.parent}' for --out {self.out}.")
        return base

    def _trace(self) -> tuple[Explanation, Film]:
        from hprs.cli.trace_columns import Wanted, parse_columns
        from hprs.cli.trace_file import open_trace
        from hprs.explanation.explanation import explain, joined
        from hprs.explanation.film import Film

        self._refuse(_OF_RUNS, fit="run", found="trace")
        if self.task is None:
            raise UsageError(
                f"'{self.subject}' is a trace: name its task too, as in --task my_task.hprs."
            )
        task = task_by_name(self.task, self.constants)
        columns = parse_columns(self.columns)
        wanted = Wanted(task, columns=columns, time=self.time, ticks=self.ticks, unused=False)
        recording = open_trace(self.subject, wanted)
        trace = joined(recording.chunks)
        found = explain(task, trace, title=str(self.subject), rate=self.rate, notes=recording.notes)
        return found, Film(trouble="a trace has none.")

    def _run(self) -> tuple[Explanation, Film]:
        import os

        from hprs.cli.assessed_run import check_which, environment_of
        from hprs.explanation.episode import record
        from hprs.explanation.explanation import explain
        from hprs.training.evaluation import FINAL_SEEDS
        from hprs.training.policies import check_fits
        from hprs.training.run_directory import find_runs
        from hprs.training.trained import load_policy

        which = check_which(self.which)
        self._refuse(_OF_TRACES, fit="trace", found="run")
        for option, value, least in (("horizon", self.horizon, 1), ("seed", self.seed, 0)):
            if value is not None and value < least:
                raise UsageError(f"--{option} must be at least {least}, got {value}.")
        run, *others = find_runs(self.subject)
        if others:
            raise UsageError(
                f"'{self.subject}' holds {len(others) + 1} seeds; name one, as in {run.path}"
            )
        # Pygame draws into memory; no window is needed.
        os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
        configuration = run.configuration
        policy = load_policy(run, which)
        make = environment_of(
            run,
            task_path=self.task,
            constants=self.constants,
            options=self.options,
            horizon=self.horizon,
        )
        environment = make()
        check_fits(str(run.policy(which)), policy, environment)
        environment.close()
        seed = FINAL_SEEDS if self.seed is None else self.seed
        played = record(make, policy, seed)
        title = (
            f"{configuration.environment}, {configuration.reward} reward, "
            f"{configuration.algorithm}, seed {configuration.seed}, {which} policy, "
            f"episode {seed}"
        )
        rate = self.rate or played.rate
        return explain(environment.task, played.trace, title=title, rate=rate), played.film
