"""`hprs train`: train a policy, or go on with a training."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import tyro

from hprs.errors import UsageError

if TYPE_CHECKING:
    from hprs.rewards.hierarchical import End
    from hprs.training.run_directory import RunDirectory


@dataclass(frozen=True)
class Train:
    """Train a policy and write a run directory; go on with one that was stopped.

    Ctrl-C saves the state and says how to go on. Nothing recorded is lost or written twice.

    Examples:
      hprs train hprs/CartPole-v0
      hprs train hprs/CartPole-v0 --seeds 5 --set learning_rate=0.001 --set net_arch=[32,32]
      hprs train hprs/CartPole-v0 --task my_task.hprs --reward sparse
      hprs train MountainCarContinuous-v0 --task my_task.hprs --steps 50000
      hprs train my_module:MyEnv-v0 --task my_task.hprs --horizon 1000
      hprs train --resume runs/hprs-CartPole-v0/hprs-ppo-1a2b3c4d
    """

    environment: Annotated[
        tyro.conf.Positional[str | None],
        tyro.conf.arg(metavar="ENV", help_behavior_hint=""),
    ] = None
    """Benchmark (`hprs tasks`), any Gymnasium id, or module:id."""
    task: Annotated[str | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """Task file; a benchmark has its own."""
    reward: str = "hprs"
    """What the learner is paid: hprs, sparse (the target alone), env (the environment's own)."""
    end: str = "paper"
    """How shaping ends an episode: paper (as printed; does not keep the optimal policy of a
    discount below 1), invariant (keeps it), released (as the paper's code)."""
    seed: int = 0
    """Seed of the training."""
    seeds: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Train the seeds 0 to N-1, one after the other."""
    steps: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Environment steps; default: what the benchmark needs, else 1,000,000."""
    algorithm: Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="")] = None
    """ppo, sac, a2c, td3, ddpg or dqn; default: sac for continuous actions, else ppo."""
    settings: Annotated[
        tyro.conf.UseAppendAction[tuple[str, ...]],
        tyro.conf.arg(name="set", metavar="KEY=VALUE"),
    ] = ()
    """A hyper-parameter, as Stable-Baselines3 names it, or environments, net_arch, scale_reward,
    action_noise, threads."""
    horizon: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """End episodes after this many steps; default: the environment's own horizon."""
    evaluate_every: Annotated[int, tyro.conf.arg(metavar="N")] = 10_000
    """Steps between two evaluations."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("runs")
    """Where run directories are made."""
    resume: Annotated[Path | None, tyro.conf.arg(metavar="RUN", help_behavior_hint="")] = None
    """Go on with this run, or with all its seeds."""

    def run(self) -> int:
        """Train."""
        from hprs.training.run_directory import find_runs

        if self.resume is not None:
            if self != Train(resume=self.resume):
                raise UsageError("--resume takes no other option: a run keeps its configuration.")
            return _train_all(find_runs(self.resume))
        return _train_all(self._create())

    def _create(self) -> list[RunDirectory]:
        from dataclasses import replace

        from hprs.training import sb3
        from hprs.training.algorithms import parse_settings
        from hprs.training.run_directory import create_runs

        if self.environment is None:
            raise UsageError("name an environment, or a run with --resume; see hprs train --help")
        if self.seeds is not None and (self.seeds < 1 or self.seed != 0):
            raise UsageError("--seeds takes a number from 1 on, and excludes --seed.")
        if self.seed < 0:
            raise UsageError(f"--seed must not be negative, got {self.seed}.")
        first = sb3.configure(
            self.environment,
            task_path=self.task,
            reward=self.reward,
            end=cast("End", self.end),
            algorithm=self.algorithm,
            settings=parse_settings(self.settings),
            steps=self.steps,
            horizon=self.horizon,
            evaluation_interval=self.evaluate_every,
        )
        seeds = [self.seed] if self.seeds is None else range(self.seeds)
        return create_runs([replace(first, seed=seed) for seed in seeds], self.out)


def _train_all(runs: list[RunDirectory]) -> int:
    from hprs.cli.console import console
    from hprs.cli.progress import TrainingProgress
    from hprs.training import sb3

    out = console()
    listener = TrainingProgress(out, seeds=len(runs))
    for run in runs:
        whole = runs[0].path if len(runs) == 1 else run.path.parent
        try:
            complete = sb3.train(run, listener)
        except KeyboardInterrupt:
            complete = False
        if not complete:
            out.print(f"Stopped. Go on with: hprs train --resume {whole}", soft_wrap=True)
            return 130
        out.print(f"Wrote {run.path}", soft_wrap=True)
    name = runs[0].path if len(runs) == 1 else runs[0].path.parent
    out.print(f"Assess it with: hprs evaluate {name}", soft_wrap=True)
    return 0
