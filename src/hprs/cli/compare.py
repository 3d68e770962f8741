"""`hprs compare`: two policies on the same episodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from hprs.cli.inputs import Constants
from hprs.errors import UsageError

if TYPE_CHECKING:
    from hprs.training.comparison import Comparison
    from hprs.training.policies import Policy
    from hprs.training.run_directory import RunDirectory
    from hprs.wrappers.single import TaskWrapper


@dataclass(frozen=True)
class Compare:
    """Compare two policies on the same episodes: paired differences with intervals.

    Both act in the environment of the first one that is a run, and are assessed by its task; with
    two policies that are no runs, --on names the environment. Of a folder of several seeds an
    episode counts with its mean over them.

    Examples:
      hprs compare runs/hprs-CartPole-v0/hprs-ppo-1a2b3c4d runs/hprs-CartPole-v0/env-ppo-5e6f7a8b
      hprs compare runs/hprs-CartPole-v0/hprs-ppo-1a2b3c4d/seed-0 random
      hprs compare one.bundle other.bundle --on hprs/SafeDriving-v0 --env tracks=trt
      hprs compare ppo.zip my_module:my_function --on CartPole-v1 --task my_task.hprs --json
    """

    one: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="RUN|POLICY")]
    """Run directory, or zero, random, a bundle, a .zip of Stable-Baselines3, an ONNX file, module:function."""
    other: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="RUN|POLICY")]
    """The same."""
    on: Annotated[str | None, tyro.conf.arg(metavar="ENV", help_behavior_hint="")] = None
    """Environment in which both act; default: that of the first one that is a run."""
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 50
    """Episodes of each policy."""
    which: str = "last"
    """The policy of a run: last, or best (by PAM)."""
    task: Annotated[str | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """Task file; default: the run's or the environment's own task."""
    constants: Constants = ()
    options: Annotated[
        tyro.conf.UseAppendAction[tuple[str, ...]],
        tyro.conf.arg(name="env", metavar="KEY=VALUE"),
    ] = ()
    """An option of the environment, as its constructor names it; default: as trained."""
    horizon: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """End episodes after this many steps; default: as trained, or as registered."""
    json: bool = False
    """Print JSON instead of a table."""

    def run(self) -> int:
        """Compare the policies."""
        from hprs.cli.assessed_run import check_which
        from hprs.cli.console import console
        from hprs.cli.progress import EvaluationProgress
        from hprs.training.comparison import compare
        from hprs.training.evaluation import FINAL_SEEDS, episode_seeds, evaluate
        from hprs.training.intervals import require_statistics

        for option, value in (("episodes", self.episodes), ("horizon", self.horizon)):
            if value is not None and value < 1:
                raise UsageError(f"--{option} must be at least 1, got {value}.")
        require_statistics()
        check_which(self.which)
        runs = [_runs(name) for name in (self.one, self.other)]
        make = self._environment([found for found in runs if found])
        groups = [
            self._policies(name, found, make)
            for name, found in zip((self.one, self.other), runs, strict=True)
        ]
        seeds = episode_seeds(FINAL_SEEDS, self.episodes)
        environment = make()
        task = environment.task
        environment.close()
        count = sum(map(len, groups))
        screen = console(stderr=True)
        with EvaluationProgress(screen, policies=count, episodes=self.episodes) as progress:
            one, other = (
                [
                    [found.assessment for found in evaluate(make, policy, seeds, watch)]
                    for policy, watch in (
                        (policy, progress.watcher(name)) for name, policy in group.items()
                    )
                ]
                for group in groups
            )
        found = compare(task, one, other)
        if self.json:
            self._print_json(found)
        else:
            self._print(found, [len(group) for group in groups])
        return 0

    def _environment(self, runs: Sequence[Sequence[RunDirectory]]) -> Callable[[], TaskWrapper]:
        from hprs.cli.assessed_run import environment_of, named_environment

        if self.on is not None:
            return named_environment(
                self.on,
                task_path=self.task,
                constants=self.constants,
                options=self.options,
                horizon=self.horizon,
            )
        if not runs:
            raise UsageError(
                f"neither '{self.one}' nor '{self.other}' is a run: name the environment in which "
                "they act, as in --on hprs/SafeDriving-v0."
            )
        return environment_of(
            runs[0][0],
            task_path=self.task,
            constants=self.constants,
            options=self.options,
            horizon=self.horizon,
        )

    def _policies(
        self, name: str, runs: Sequence[RunDirectory], make: Callable[[], TaskWrapper]
    ) -> Mapping[str, Policy]:
        from hprs.cli.assessed_run import check_which, policies_of_runs, policy_by_name

        if runs:
            return policies_of_runs(runs, check_which(self.which), make)
        return {name: policy_by_name(name, make)}

    def _print(self, found: Comparison, seeds: Sequence[int]) -> None:
        from hprs.cli.console import decimals, interval, plural, print_table
        from hprs.training.measures import SUMMARY

        rows = [
            [
                name,
                decimals(row.one),
                decimals(row.other),
                f"{row.difference.value:+.3f}",
                interval(row.difference.low, row.difference.high),
            ]
            for name, row in found.differences.items()
        ]
        print(f"one    {self.one}")
        print(f"other  {self.other}")
        print_table(
            ["", "one", "other", "other - one", "95 % interval"],
            rows,
            title=f"{plural(found.episodes, 'episode')} each, the same for both",
            breaks=(len(SUMMARY) - 1,),
        )
        tied = found.episodes - found.better - found.worse
        print()
        print(
            f"PAM: one is higher in {found.better}, other in {found.worse}, equal in {tied}: "
            f"one is the better with probability {found.probability:.2f} (ties count half)."
        )
        print("Intervals are over episodes, of the differences episode by episode: bootstrap.")
        if max(seeds) > 1:
            print("The spread between seeds is not in them.")

    def _print_json(self, found: Comparison) -> None:
        from hprs.cli.console import print_json

        print_json(
            {
                "one": self.one,
                "other": self.other,
                "episodes": found.episodes,
                "measures": {name: asdict(row) for name, row in found.differences.items()},
                "better": found.better,
                "worse": found.worse,
                "probability": found.probability,
            }
        )


def _runs(name: str) -> list[RunDirectory]:
    """The runs in a folder; none where the name is a policy's."""
    from hprs.training.run_directory import find_runs

    path = Path(name)
    is_policy = path.is_file() or ":" in name or name in ("zero", "random") or path.suffix
    return [] if is_policy and not path.is_dir() else find_runs(path)
