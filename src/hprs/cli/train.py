"""`hprs train`: train a policy, or go on with a training."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from hprs.cli.inputs import Constants
from hprs.errors import UsageError
from hprs.rewards.registry import REWARDS
from hprs.rewards.shaping import End
from hprs.training.algorithms import (
    ALGORITHMS,
    DEFAULT_ALGORITHM,
    DEFAULT_STEPS,
    OURS,
    TRAINERS,
)
from hprs.training.configuration import OFTEN, SELDOM, Configuration
from hprs.training.ppo.settings import HYPERPARAMETERS

if TYPE_CHECKING:
    from hprs.training.run_directory import RunDirectory

_ANY_HORIZON = 10**9


@dataclass(frozen=True)
class Train:
    """Train a policy and write a run directory; go on with one that was stopped.

    Ctrl-C saves the state and says how to go on. Whatever ends the process, nothing recorded is
    lost or written twice.

    Examples:
      hprs train hprs/CartPole-v0
      hprs train hprs/CartPole-v0 --seeds 5 --set learning_rate=0.001 --set net_arch=[32,32]
      hprs train hprs/CartPole-v0 --task my_task.hprs --reward sparse
      hprs train hprs/CartPole-v0 --const mark=-1
      hprs train hprs/CartPole-v0 --reward bhnr --reward-set window=50
      hprs train hprs/LunarLanderObstacle-v0 --env obstacle=[-0.1,0.1]
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
    constants: Constants = ()
    reward: Annotated[
        str, tyro.conf.arg(help=f"What the learner is paid: {', '.join(REWARDS)}.")
    ] = Configuration.reward
    end: str = Configuration.end
    """How shaping ends an episode: paper (as printed; does not keep the optimal policy of a
    discount below 1), invariant (keeps it), released (as the paper's code)."""
    reward_options: Annotated[
        tyro.conf.UseAppendAction[tuple[str, ...]],
        tyro.conf.arg(
            name="reward-set",
            metavar="KEY=VALUE",
            help="An option of the reward: "
            + "; ".join(
                f"{', '.join(kind.options)} of {name}"
                for name, kind in REWARDS.items()
                if kind.options
            )
            + ".",
        ),
    ] = ()
    seed: int = Configuration.seed
    """Seed of the training."""
    seeds: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Train the seeds 0 to N-1, one after the other."""
    steps: Annotated[
        int | None,
        tyro.conf.arg(
            metavar="N",
            help_behavior_hint="",
            help="Environment steps; default: those of the benchmark's file, "
            f"else {DEFAULT_STEPS:,}.",
        ),
    ] = None
    algorithm: Annotated[
        str | None,
        tyro.conf.arg(
            metavar="NAME",
            help_behavior_hint="",
            help=f"{', '.join(ALGORITHMS)}; default: {DEFAULT_ALGORITHM}.",
        ),
    ] = None
    trainer: Annotated[
        str | None,
        tyro.conf.arg(
            metavar="NAME",
            help_behavior_hint="",
            help="; ".join(
                f"{trainer} ({', '.join(offered)})" for trainer, offered in TRAINERS.items()
            )
            + "; default: the first that has the algorithm.",
        ),
    ] = None
    settings: Annotated[
        tyro.conf.UseAppendAction[tuple[str, ...]],
        tyro.conf.arg(
            name="set",
            metavar="KEY=VALUE",
            help="A hyper-parameter. Of the trainer jax, ppo: "
            f"{', '.join(HYPERPARAMETERS)}. Of sb3: as Stable-Baselines3 names it, or one of "
            f"{', '.join(OURS)}.",
        ),
    ] = ()
    options: Annotated[
        tyro.conf.UseAppendAction[tuple[str, ...]],
        tyro.conf.arg(name="env", metavar="KEY=VALUE"),
    ] = ()
    """An option of the environment, as its constructor names it."""
    horizon: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """End episodes after this many steps; default: the environment's own horizon."""
    evaluate_every: Annotated[
        int | None,
        tyro.conf.arg(
            metavar="N",
            help_behavior_hint="",
            help="Steps between two evaluations; default: with the trainer jax a hundredth of the "
            f"training, with sb3 {Configuration.evaluation_interval:,}. With jax it becomes "
            f"{SELDOM} times as long after {OFTEN} evaluations.",
        ),
    ] = None
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

        from hprs.training.run_directory import create_runs

        first = self._configure()
        seeds = [self.seed] if self.seeds is None else range(self.seeds)
        return create_runs([replace(first, seed=seed) for seed in seeds], self.out)

    def _configure(self) -> Configuration:
        from typing import cast

        from hprs.spec.parameters import parse_constants
        from hprs.training.algorithms import parse_settings
        from hprs.training.configure import configure

        if self.environment is None:
            raise UsageError("name an environment, or a run with --resume; see hprs train --help")
        if _is_run(Path(self.environment)):
            raise UsageError(
                f"'{self.environment}' is a run. Go on with it: "
                f"hprs train --resume {self.environment}"
            )
        if self.seeds is not None and (self.seeds < 1 or self.seed != Configuration.seed):
            raise UsageError("--seeds takes a number from 1 on, and excludes --seed.")
        if self.seed < 0:
            raise UsageError(f"--seed must not be negative, got {self.seed}.")
        return configure(
            self.environment,
            task_path=self.task,
            constants=parse_constants(self.constants),
            reward=self.reward,
            end=cast("End", self.end),
            reward_options=parse_settings(self.reward_options, "--reward-set"),
            algorithm=self.algorithm,
            trainer=self.trainer,
            settings=parse_settings(self.settings),
            environment_options=parse_settings(self.options, "--env"),
            steps=self.steps,
            horizon=self.horizon,
            evaluation_interval=self.evaluate_every,
        )


def _is_run(path: Path) -> bool:
    from hprs.training.run_directory import RUN_FILE

    return any(file.is_file() for file in (path / RUN_FILE, *path.glob(f"*/{RUN_FILE}")))


def _demands(configuration: Configuration) -> list[str]:
    """What the reward asks of the learner, and whether it gets it."""
    from hprs.rewards.base import demands_of
    from hprs.rewards.registry import make_reward
    from hprs.training.parameters import demanded_parameters

    reward = make_reward(
        configuration.reward,
        configuration.task,
        end=configuration.end,
        discount=configuration.discount,
        # It changes nothing here; some rewards need one.
        horizon=configuration.horizon or _ANY_HORIZON,
        **configuration.reward_options,
    )
    lines: list[str] = []
    for name, value in demanded_parameters(demands_of(reward)).items():
        found = configuration.parameters.get(name)
        kept = "" if found == value else f", but it was set to {json.dumps(found)}"
        lines.append(
            f"The reward {configuration.reward} asks for {name}={json.dumps(value)}{kept}."
        )
    return lines


def _train_all(runs: list[RunDirectory]) -> int:
    from hprs.cli.console import console
    from hprs.cli.progress import TrainingProgress
    from hprs.training.trainers import trainer_of

    out = console()
    listener = TrainingProgress(out, seeds=len(runs))
    whole = runs[0].path if len(runs) == 1 else runs[0].path.parent
    for line in _demands(runs[0].configuration):
        out.print(line, soft_wrap=True)
    for run in runs:
        before = listener.trainings
        try:
            complete = trainer_of(run.configuration)(run, listener)
        except KeyboardInterrupt:
            complete = False
        if not complete:
            out.print(f"Stopped. Go on with: hprs train --resume {whole}", soft_wrap=True)
            return 130
        # A run that was complete already has said so.
        if listener.trainings > before:
            out.print(f"Wrote {run.path}", soft_wrap=True)
    out.print(f"Assess it with: hprs evaluate {whole}", soft_wrap=True)
    return 0
