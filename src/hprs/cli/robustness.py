"""`hprs robustness`: a driving policy under what it never saw."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from hprs.errors import UsageError, did_you_mean

if TYPE_CHECKING:
    from hprs.cli.robustness_subject import Subject
    from hprs.experiments.perturbations import NamedTrack
    from hprs.experiments.robustness_result import Row


@dataclass(frozen=True)
class Robustness:
    """Test driving policies under parameters, latency, faults of sensors and tracks they never saw.

    Each randomised parameter is swept from below its range to beyond it while all others are drawn
    as in the training; commands are obeyed up to 200 ms late; scans are dropped; the measured speed
    is biased; and the car drives the built-in tracks both ways and 20 generated ones. Every point
    has the same seeded episodes; of two policies both are swept on the tracks of the first one's
    training. Prints a table, and writes it as CSV with a picture.

    Examples:
      hprs robustness runs/hprs-SafeDriving-v0/hprs-ppo-1a2b3c4d/seed-0
      hprs robustness one.bundle other.bundle --on hprs/SafeDriving-v0 --out robustness
      hprs robustness RUN --sweep latency --sweep track
      hprs robustness RUN --sweep friction=0.3,0.5,0.7,0.9 --episodes 100
    """

    policies: Annotated[
        tyro.conf.Positional[tuple[str, ...]], tyro.conf.arg(metavar="RUN|BUNDLE [RUN|BUNDLE]")
    ]
    """One policy, or two: run directories or policy bundles."""
    on: Annotated[str | None, tyro.conf.arg(metavar="ENV", help_behavior_hint="")] = None
    """Environment of a bundle that does not say where it was trained."""
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 20
    """Episodes at each point."""
    which: str = "last"
    """The policy of a run: last, or best (by PAM)."""
    options: Annotated[
        tyro.conf.UseAppendAction[tuple[str, ...]],
        tyro.conf.arg(name="env", metavar="KEY=VALUE"),
    ] = ()
    """An option of the environment, as its constructor names it; default: as trained."""
    sweep: Annotated[
        tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="NAME[=VALUE,VALUE]")
    ] = ()
    """Test this alone, and under these values; track: the tracks. Default: everything."""
    out: Annotated[str, tyro.conf.arg(metavar="DIR")] = "robustness"
    """Where robustness.csv, robustness.png and robustness.svg are written."""

    def run(self) -> int:
        """Test the policies."""
        from hprs.cli.robustness_subject import subject_of
        from hprs.cli.robustness_table import print_rows
        from hprs.experiments.robustness_figure import draw
        from hprs.experiments.robustness_result import as_csv
        from hprs.training.environment import require
        from hprs.training.files import replace, writing
        from hprs.training.intervals import require_statistics

        self._check()
        require_statistics()
        require("matplotlib", "report")
        sweeps = sweeps_of(self.sweep)
        subjects = [
            subject_of(name, on=self.on, which=self.which, options=self.options)
            for name in self.policies
        ]
        environments = [subject.environment for subject in subjects]
        if len(set(environments)) > 1:
            raise UsageError(
                f"'{self.policies[0]}' drives {environments[0]}, '{self.policies[1]}' "
                f"{environments[1]}: policies of one environment can be compared."
            )
        folder = Path(self.out)
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
        rows = self._rows(subjects, sweeps)
        print_rows(rows)
        tracks = ", ".join(subjects[0].seen)
        print(f"Driven on {tracks}, where no other track is named.")
        files = {"csv": as_csv(rows).encode(), **draw(rows)}
        with writing(folder):
            for ending, data in files.items():
                replace(folder / f"robustness.{ending}", data)
        print(f"Written: {', '.join(str(folder / f'robustness.{ending}') for ending in files)}")
        return 0

    def _check(self) -> None:
        from hprs.cli.assessed_run import check_which

        if not 1 <= len(self.policies) <= 2:
            raise UsageError(f"one or two policies are tested, not {len(self.policies)}.")
        if len(set(self.policies)) < len(self.policies):
            raise UsageError(f"'{self.policies[0]}' is named twice.")
        if self.episodes < 1:
            raise UsageError(f"--episodes must be at least 1, got {self.episodes}.")
        check_which(self.which)

    def _rows(
        self, subjects: Sequence[Subject], sweeps: Mapping[str, Sequence[float]]
    ) -> list[Row]:
        """What all policies make of all points."""
        from hprs.cli.console import console
        from hprs.cli.progress import EvaluationProgress
        from hprs.experiments.perturbations import TRACK, tracks_of_test
        from hprs.experiments.robustness import try_policies
        from hprs.training.evaluation import FINAL_SEEDS, episode_seeds
        from hprs.training.simulations import simulation_of

        screen = console(stderr=True)
        tracks: Sequence[NamedTrack] = ()
        if TRACK in sweeps:
            with screen.status("Making the tracks"):
                tracks = tracks_of_test([name for subject in subjects for name in subject.seen])
        numbers = {name: values for name, values in sweeps.items() if name != TRACK}
        seeds = episode_seeds(FINAL_SEEDS, self.episodes)
        points = 1 + sum(map(len, numbers.values())) + len(tracks)
        count = sum(len(subject.policies) for subject in subjects)
        rows: list[Row] = []
        # What differs between two policies must not be the tracks.
        ground = simulation_of(subjects[0].make()).tracks
        with EvaluationProgress(
            screen, policies=count, episodes=points * self.episodes
        ) as progress:
            for subject in subjects:
                rows += try_policies(
                    subject.name,
                    subject.make,
                    subject.policies,
                    seen=subject.seen,
                    sweeps=numbers,
                    ground=ground,
                    tracks=tracks,
                    seeds=seeds,
                    watcher=progress.watcher,
                )
        return rows


def sweeps_of(given: Sequence[str]) -> dict[str, Sequence[float]]:
    """Name of a perturbation to its values, as the command line has them.

    Args:
        given: `NAME` or `NAME=VALUE,VALUE`; nothing stands for everything.

    Raises:
        UsageError: There is no such perturbation, or a value is no number.
    """
    from hprs.experiments.perturbations import TRACK, perturbations

    known: dict[str, Sequence[float]] = {**perturbations(), TRACK: ()}
    found: dict[str, Sequence[float]] = {}
    for text in given:
        name, equals, values = text.partition("=")
        if name not in known:
            raise UsageError(
                f"There is no perturbation '{name}'.{did_you_mean(name, known)} "
                f"There are {', '.join(known)}."
            )
        if equals and name == TRACK:
            raise UsageError(f"--sweep {TRACK} has no values; --env tracks=NAME drives others.")
        found[name] = _numbers(name, values) if equals else known[name]
    return found or known


def _numbers(name: str, values: str) -> Sequence[float]:
    try:
        return sorted({float(value) for value in values.split(",")})
    except ValueError:
        raise UsageError(
            f"--sweep {name} needs numbers between commas, as in {name}=0.1,0.2; got '{values}'."
        ) from None
