"""`hprs evaluate`: how well a policy meets each requirement."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from hprs.cli.inputs import Constants
from hprs.errors import UsageError

if TYPE_CHECKING:
    from hprs.semantics.assessment import Assessment
    from hprs.spec.task import Task
    from hprs.training.policies import Policy
    from hprs.wrappers.single import TaskWrapper


@dataclass(frozen=True)
class Evaluate:
    """Assess a policy: S, S+T, S+T+C, PAM and every requirement, beside doing nothing and random.

    A folder of several seeds is pooled, with the worst seed beside. The episodes are none of those
    that chose the best policy. A .zip of Stable-Baselines3 can execute code: trust it first.

    Examples:
      hprs evaluate runs/hprs-CartPole-v0/hprs-ppo-1a2b3c4d/seed-0
      hprs evaluate runs/hprs-CartPole-v0/hprs-ppo-1a2b3c4d --which best --episodes 100
      hprs evaluate runs/hprs-BipedalWalker-v0/hprs-sac-1a2b3c4d --env goal=55.4 --horizon 1000
      hprs evaluate policy.bundle --env tracks=trt
      hprs evaluate hprs/CartPole-v0 --policy random
      hprs evaluate CartPole-v1 --task my_task.hprs --policy ppo.zip
      hprs evaluate CartPole-v1 --task my_task.hprs --policy my_module:my_function --json
    """

    subject: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="RUN|BUNDLE|ENV")]
    """Run directory, or a policy bundle; with --policy, an environment."""
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 50
    """Episodes of each policy."""
    which: str = "last"
    """The policy of a run: last, or best (by PAM)."""
    task: Annotated[str | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """Task file for an environment without its own; for a run, a task to assess it by instead."""
    constants: Constants = ()
    policy: Annotated[str | None, tyro.conf.arg(metavar="POLICY", help_behavior_hint="")] = None
    """zero, random, a bundle, a .zip of Stable-Baselines3, an ONNX file, or module:function."""
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
        """Assess the policy."""
        from hprs.cli.console import console
        from hprs.cli.progress import EvaluationProgress
        from hprs.training.demanding import held_at_every_reset, remarks
        from hprs.training.evaluation import FINAL_SEEDS, episode_seeds, evaluate
        from hprs.training.intervals import require_statistics
        from hprs.training.policies import floors

        for option, value in (("episodes", self.episodes), ("horizon", self.horizon)):
            if value is not None and value < 1:
                raise UsageError(f"--{option} must be at least 1, got {value}.")
        require_statistics()
        title, make, policies = self._subject()
        seeds = episode_seeds(FINAL_SEEDS, self.episodes)
        environment = make()
        task, space = environment.task, environment.action_space
        environment.close()
        lower = {
            name: policy
            for name, policy in floors(space).items()
            if self.policy != {"doing nothing": "zero"}.get(name, name)
        }
        count = len(lower) + len(policies)
        screen = console(stderr=True)
        with EvaluationProgress(screen, policies=count, episodes=self.episodes) as progress:

            def assessments(name: str, policy: Policy) -> list[Assessment]:
                episodes = evaluate(make, policy, seeds, progress.watcher(name))
                return [episode.assessment for episode in episodes]

            lowest = {name: assessments(name, policy) for name, policy in lower.items()}
            found = {name: assessments(name, policy) for name, policy in policies.items()}
        too_little = remarks(task, held_at_every_reset(make, seeds), lowest)
        show = _print_json if self.json else _print
        show(title, task, found, lowest, too_little)
        return 0

    def _subject(self) -> tuple[str, Callable[[], TaskWrapper], Mapping[str, Policy]]:
        from hprs.cli.assessed_run import bundle_file

        if self.policy:
            return self._policy()
        if (bundle := bundle_file(self.subject)) is not None:
            return self._bundle(bundle)
        return self._run()

    def _bundle(self, path: str) -> tuple[str, Callable[[], TaskWrapper], Mapping[str, Policy]]:
        from hprs.cli.assessed_run import environment_of_bundle
        from hprs.training.policies import check_fits

        name, bundle, make = environment_of_bundle(
            path,
            task_path=self.task,
            constants=self.constants,
            options=self.options,
            horizon=self.horizon,
        )
        environment = make()
        check_fits(path, bundle, environment)
        environment.close()
        return f"{name}, policy {path}", make, {"policy": bundle}

    def _run(self) -> tuple[str, Callable[[], TaskWrapper], Mapping[str, Policy]]:
        from hprs.cli.assessed_run import check_which, environment_of, policies_of_runs
        from hprs.training.run_directory import find_runs

        which = check_which(self.which)
        if not Path(self.subject).exists() and self._is_environment():
            raise UsageError(
                f"'{self.subject}' is an environment: name a policy too, as in --policy random."
            )
        runs = find_runs(Path(self.subject))
        make = environment_of(
            runs[0],
            task_path=self.task,
            constants=self.constants,
            options=self.options,
            horizon=self.horizon,
        )
        configuration = runs[0].configuration
        title = (
            f"{configuration.environment}, {configuration.reward} reward, "
            f"{configuration.algorithm}, {self.which} policy"
        )
        return title, make, policies_of_runs(runs, which, make)

    def _policy(self) -> tuple[str, Callable[[], TaskWrapper], Mapping[str, Policy]]:
        from hprs.cli.assessed_run import named_environment, policy_by_name

        make = named_environment(
            self.subject,
            task_path=self.task,
            constants=self.constants,
            options=self.options,
            horizon=self.horizon,
        )
        policy = policy_by_name(str(self.policy), make)
        return f"{self.subject}, policy {self.policy}", make, {"policy": policy}

    def _is_environment(self) -> bool:
        import gymnasium as gym

        from hprs.envs.registration import benchmark_of

        return self.subject in gym.registry or benchmark_of(self.subject) is not None


def _worst(task: Task, found: Mapping[str, Sequence[Assessment]]) -> dict[str, tuple[float, str]]:
    """Name of a measure to its lowest mean over a seed, and that seed."""
    from hprs.training.measures import measures

    each = {name: measures(task, assessments) for name, assessments in found.items()}
    names = next(iter(each.values()))
    return {name: min((each[seed][name].value, seed) for seed in each) for name in names}


def _pool(found: Mapping[str, Sequence[Assessment]]) -> list[Assessment]:
    return [assessment for assessments in found.values() for assessment in assessments]


def _print_json(
    title: str,
    task: Task,
    found: Mapping[str, Sequence[Assessment]],
    floors: Mapping[str, Sequence[Assessment]],
    too_little: Sequence[str],
) -> None:
    from hprs.cli.console import print_json
    from hprs.training.measures import measures, outside_ranges

    pooled = _pool(found)
    content: dict[str, Any] = {
        "subject": title,
        "episodes": len(pooled),
        "measures": {name: asdict(value) for name, value in measures(task, pooled).items()},
        "floors": {
            floor: {name: asdict(value) for name, value in measures(task, assessments).items()}
            for floor, assessments in floors.items()
        },
        "outside_ranges": dict(outside_ranges(pooled)),
        "asks_too_little": list(too_little),
        "decided_at_start": sum(bool(assessment.decided_at_start) for assessment in pooled),
    }
    if len(found) > 1:
        content["worst"] = {
            name: {"value": value, "of": seed}
            for name, (value, seed) in _worst(task, found).items()
        }
    print_json(content)


def _print(
    title: str,
    task: Task,
    found: Mapping[str, Sequence[Assessment]],
    floors: Mapping[str, Sequence[Assessment]],
    too_little: Sequence[str],
) -> None:
    from hprs.cli.console import plural
    from hprs.cli.measures_table import print_measures, print_notes
    from hprs.training.measures import measures

    pooled = _pool(found)
    several = len(found) > 1
    count = plural(len(pooled), "episode")
    extra = {"worst seed": _worst(task, found)} if several else {}
    print_measures(
        f"{title}: {count}" + (f" of {len(found)} seeds" if several else ""),
        task,
        measures(task, pooled),
        floors={
            name: {key: measure.value for key, measure in measures(task, assessments).items()}
            for name, assessments in floors.items()
        },
        worst=extra.get("worst seed"),
    )
    print_notes(pooled, several=several)
    for remark in too_little:
        print(f"The task asks too little: {remark}")
