"""One table of the benchmarks, and their registration with Gymnasium."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hprs.spec.task import Task

TASK_FILE = "task.hprs"


@dataclass(frozen=True)
class Benchmark:
    """An environment of ours and its task."""

    id: str
    """Gymnasium's name of the bare environment, without the task."""
    package: str
    """The package that holds `env.py` and the task file."""
    entry_point: str
    """Where the environment's class is, its module and its name with a colon between them."""
    horizon: int
    """Steps after which an episode is truncated."""
    description: str
    """One line for people who choose."""
    vector_entry_point: str | None = None
    """A vectorised version of it, where there is one."""
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """Arguments that make this benchmark of the class."""
    hyperparameters: str = "hyperparameters.toml"
    """The file in the package that says what it is trained with."""

    @property
    def task_text(self) -> str:
        """The text of its task."""
        return resources.files(self.package).joinpath(TASK_FILE).read_text(encoding="utf-8")

    @property
    def task(self) -> Task:
        """Its task."""
        from hprs.spec.parser import parse_task

        return parse_task(self.task_text, path=f"{self.id}/{TASK_FILE}")

    @property
    def hyperparameters_text(self) -> str:
        """The text of its hyper-parameters."""
        file = resources.files(self.package).joinpath(self.hyperparameters)
        return file.read_text(encoding="utf-8")


BENCHMARKS: Mapping[str, Benchmark] = MappingProxyType(
    {
        benchmark.id: benchmark
        for benchmark in (
            Benchmark(
                id="hprs/CartPole-v0",
                package="hprs.envs.cart_pole",
                entry_point="hprs.envs.cart_pole.env:CartPole",
                horizon=500,
                description="keep a pole up and park its cart on a mark",
                vector_entry_point="hprs.envs.cart_pole.env:CartPoleVector",
            ),
            Benchmark(
                id="hprs/LunarLanderObstacle-v0",
                package="hprs.envs.lunar_lander",
                entry_point="hprs.envs.lunar_lander.env:LunarLanderObstacle",
                horizon=600,
                description="fly round an obstacle, land on the pad and stay there",
            ),
            Benchmark(
                id="hprs/BipedalWalker-v0",
                package="hprs.envs.bipedal_walker",
                entry_point="hprs.envs.bipedal_walker.env:BipedalWalker",
                horizon=500,
                description="walk to a goal without falling",
                hyperparameters="even.toml",
            ),
            Benchmark(
                id="hprs/BipedalWalkerHardcore-v0",
                package="hprs.envs.bipedal_walker",
                entry_point="hprs.envs.bipedal_walker.env:BipedalWalker",
                horizon=500,
                description="the same over stumps, pits and stairs",
                options={"hardcore": True},
                hyperparameters="hardcore.toml",
            ),
            Benchmark(
                id="hprs/SafeDriving-v0",
                package="hprs.envs.safe_driving",
                entry_point="hprs.envs.safe_driving.env:SafeDriving",
                horizon=250,
                description="drive one lap fast, smoothly and off the walls",
                vector_entry_point="hprs.envs.safe_driving.env:SafeDrivingVector",
            ),
            Benchmark(
                id="hprs/FollowLeader-v0",
                package="hprs.envs.follow_leader",
                entry_point="hprs.envs.follow_leader.env:FollowLeader",
                horizon=300,
                description="drive one lap behind a leader, neither close nor far",
                vector_entry_point="hprs.envs.follow_leader.env:FollowLeaderVector",
            ),
        )
    }
)
"""Environment id to benchmark; the only place that lists them."""


def register() -> None:
    """Register the benchmarks with Gymnasium; a second call does nothing.

    Gymnasium 1.0 and later find no environments by themselves: import `hprs.envs`, or name it, as
    in `gymnasium.make("hprs.envs:hprs/CartPole-v0")`.
    """
    # Not at the top: the table above is read where no environment is wanted.
    from gymnasium.envs.registration import register as register_environment
    from gymnasium.envs.registration import registry

    for benchmark in BENCHMARKS.values():
        if benchmark.id not in registry:
            register_environment(
                benchmark.id,
                entry_point=benchmark.entry_point,
                vector_entry_point=benchmark.vector_entry_point,
                max_episode_steps=benchmark.horizon,
                kwargs=dict(benchmark.options),
            )


def benchmark_of(environment: str) -> Benchmark | None:
    """The benchmark that an id names, as `module:id` too; None for an environment not of ours."""
    return BENCHMARKS.get(environment.rpartition(":")[2])


def task_text_of(environment: str) -> str | None:
    """The text of a benchmark's task; None for an environment that is not ours."""
    benchmark = benchmark_of(environment)
    return None if benchmark is None else benchmark.task_text


def task_of(environment: str) -> Task | None:
    """The task of a benchmark; None for an environment that is not ours."""
    benchmark = benchmark_of(environment)
    return None if benchmark is None else benchmark.task
