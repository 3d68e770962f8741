"""Every benchmark trains with every reward that a learner of one number can have.

Trainings of sixteen steps with networks of four units and episodes of at most six steps: whether
the parts fit, not whether anything is learned.
"""

from __future__ import annotations

from typing import Any

import pytest

from hprs.envs import BENCHMARKS
from hprs.rewards import REWARDS
from hprs.training.configure import configure
from hprs.training.run_directory import create_runs
from hprs.training.trainers import trainer_of
from tests.rewards.episodes import options_of

SMALLEST = {"environments": 1, "n_steps": 8, "batch_size": 8, "n_epochs": 1, "net_arch": [4]}
STEPS, HORIZON = 16, 6


NUMBERS = [name for name in REWARDS if name != "vector"]

CASES = [
    *(("sb3", environment, reward) for environment in BENCHMARKS for reward in NUMBERS),
    # A training of the JAX trainer compiles, so only every benchmark and every reward once.
    *(("jax", "hprs/CartPole-v0", reward) for reward in NUMBERS),
    *(("jax", environment, "hprs") for environment in list(BENCHMARKS)[1:]),
]


@pytest.mark.parametrize(("trainer", "environment", "reward"), CASES)
def test_a_benchmark_trains_with_a_reward(
    tmp_path: Any, trainer: str, environment: str, reward: str
) -> None:
    configuration = configure(
        environment,
        algorithm="ppo",
        trainer=trainer,
        settings=SMALLEST,
        reward=reward,
        reward_options=options_of(reward, BENCHMARKS[environment].task),
        horizon=HORIZON,
        steps=STEPS,
        evaluation_interval=STEPS,
        evaluation_episodes=1,
    )
    [run] = create_runs([configuration], tmp_path)
    assert trainer_of(configuration)(run)
    first, last = [int(row["step"]) for row in run.evaluations()]
    # A rollout may pass the end of the training.
    assert first == 0
    assert STEPS <= last < STEPS + SMALLEST["n_steps"]
