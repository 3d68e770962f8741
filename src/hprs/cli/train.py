"""`hprs train`: train a policy, or go on with a training."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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


@dataclass(frozen=True)
class Train:
    """Train a policy and write a run directory; go on with one that was stopped.

    Several seeds, rewards or ends are a population: one run of each combination. Ctrl-C saves the
    state and says how to go on. Whatever ends the process, nothing recorded is lost or written
    twice.

    Examples:
      hprs train hprs/CartPole-v0
      hprs train hprs/CartPole-v0 --seeds 5 --set learning_rate=0.001 --set net_arch=[32,32]
      hprs train hprs/CartPole-v0 --task my_task.hprs --reward sparse
      hprs train hprs/CartPole-v0 --seeds 10 --reward hprs,env,tltl --end paper,released
      hprs train hprs/CartPole-v0 --const mark=-1
      hprs train hprs/CartPole-v0 --reward bhnr --reward-set window=50
      hprs train hprs/LunarLanderObstacle-v0 --env obstacle=[-0.1,0.1]
      hprs train MountainCarContinuous-v0 --task my_task.hprs --steps 50000 --algorithm sac
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
        str,
        tyro.conf.arg(
            help=f"What the learner is paid: {', '.join(REWARDS)}; or several: hprs,env.",
        ),
    ] = Configuration.reward
    end: str = Configuration.end
    """How shaping ends an episode: paper (as printed; does not keep the optimal policy of a
    discount below 1), invariant (keeps it), released (as the paper's code); or several of them."""
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
    """Train the seeds 0 to N-1."""
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
            f"training, with its sac at most {Configuration.evaluation_interval:,}, with sb3 "
            f"{Configuration.evaluation_interval:,}. With jax's ppo it becomes {SELDOM} times as "
            f"long after {OFTEN} evaluations.",
        ),
    ] = None
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("runs")
    """Where run directories are made."""
    workers: Annotated[
        int | None,
        tyro.conf.arg(
            metavar="N",
            help_behavior_hint="",
            help="Runs that are trained side by side, each in a process of its own; 0: all in one "
            "program. Default: with the trainer jax one a core, on a GPU 0; with sb3 one.",
        ),
    ] = None
    resume: Annotated[Path | None, tyro.conf.arg(metavar="RUN", help_behavior_hint="")] = None
    """Go on with this run, with all its seeds, or with a population; a run that was started with
    others goes on with all of them."""

    def run(self) -> int:
        """Train."""
        from hprs.cli.training import train_all

        if self.workers is not None and self.workers < 0:
            raise UsageError(f"--workers takes a number from 0 on, got {self.workers}.")
        if self.resume is not None:
            if self != Train(resume=self.resume, workers=self.workers):
                raise UsageError("--resume takes no other option: a run keeps its configuration.")
            return train_all(*_resumed(self.resume), self.workers)
        return train_all(*self._create(), self.workers)

    def _create(self) -> tuple[list[RunDirectory], Path]:
        """New runs, and the place that stands for all of them."""
        from dataclasses import replace

        from hprs.training.population_file import write_population
        from hprs.training.run_directory import create_runs

        self._check()
        seeds = [self.seed] if self.seeds is None else range(self.seeds)
        found = self._configurations()
        runs = create_runs([replace(c, seed=seed) for c in found for seed in seeds], self.out)
        if len(runs) == 1:
            return runs, runs[0].path
        return runs, write_population([run.path for run in runs])

    def _check(self) -> None:
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

    def _configurations(self) -> list[Configuration]:
        """One for each reward and end, as far as they differ; the seed is the first."""
        rewards, ends = _listed(self.reward), _listed(self.end)
        found: dict[str, Configuration] = {}
        for reward in rewards:
            shaped = reward not in REWARDS or REWARDS[reward].shaped
            # Another end would be the same training again.
            for end in ends if shaped else ends[:1]:
                configuration = self._configure(reward, end, self._options_of(reward, rewards))
                found.setdefault(configuration.digest, configuration)
        return list(found.values())

    def _options_of(self, reward: str, rewards: Sequence[str]) -> dict[str, Any]:
        """The options of one of several rewards: each takes those that it has."""
        from hprs.training.algorithms import parse_settings

        given = parse_settings(self.reward_options, "--reward-set")
        if len(rewards) == 1:
            return given
        known = {option for name in rewards if name in REWARDS for option in REWARDS[name].options}
        for option in given:
            if option not in known:
                raise UsageError(f"none of the rewards {', '.join(rewards)} has '{option}'.")
        own = REWARDS[reward].options if reward in REWARDS else ()
        return {option: value for option, value in given.items() if option in own}

    def _configure(self, reward: str, end: str, options: dict[str, Any]) -> Configuration:
        from typing import cast

        from hprs.spec.parameters import parse_constants
        from hprs.training.algorithms import parse_settings
        from hprs.training.configure import configure

        return configure(
            str(self.environment),
            task_path=self.task,
            constants=parse_constants(self.constants),
            reward=reward,
            end=cast("End", end),
            reward_options=options,
            algorithm=self.algorithm,
            trainer=self.trainer,
            settings=parse_settings(self.settings),
            environment_options=parse_settings(self.options, "--env"),
            steps=self.steps,
            horizon=self.horizon,
            evaluation_interval=self.evaluate_every,
        )


def _listed(names: str) -> list[str]:
    return [name.strip() for name in names.split(",")]


def _is_run(path: Path) -> bool:
    from hprs.training.population_file import is_population
    from hprs.training.run_directory import RUN_FILE

    runs = (path / RUN_FILE, *path.glob(f"*/{RUN_FILE}"))
    return any(file.is_file() for file in runs) or is_population(path)


def _resumed(place: Path) -> tuple[list[RunDirectory], Path]:
    """The runs to go on with, and the place that stands for all of them."""
    from hprs.training.population_file import population_of
    from hprs.training.run_directory import find_runs

    runs = find_runs(place, mixed=True)
    population = population_of(place)
    if population is None:
        return runs, place
    print(f"{place} is of {population}: all its runs go on.")
    return find_runs(population, mixed=True), population
