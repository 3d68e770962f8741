import os
import signal

import gymnasium as gym
import numpy as np
import pytest

import hprs
from hprs.envs import task_of
from hprs.errors import UsageError
from hprs.training import evaluation, sb3
from hprs.training.environment import make_environment
from hprs.training.evaluation import (
    FINAL_SEEDS,
    TRAINING_SEEDS,
    episode_seeds,
    evaluate,
    training_seeds,
)
from hprs.training.policies import ConstantPolicy, RandomPolicy, do_nothing
from hprs.training.run_directory import create_runs
from hprs.training.sb3 import recorder
from tests.training.small import ppo, same_numbers

ID = "hprs/CartPole-v0"


def make():
    return make_environment(ID, task_of(ID))


class Balance:
    """Keeps the pole up for a while, without memory."""

    def __call__(self, observation):
        return int(observation[2] + 0.2 * observation[3] > 0)


class BatchedBalance(Balance):
    def batch(self, observations):
        return [self(observation) for observation in observations]


def test_the_same_seeds_give_the_same_episodes():
    assert evaluate(make, Balance(), [1, 2]) == evaluate(make, Balance(), [1, 2])
    one, two = evaluate(make, Balance(), [1, 2])
    assert one.total != two.total


def test_episodes_side_by_side_are_the_episodes_one_by_one():
    seeds = episode_seeds(7, evaluation.SIDE_BY_SIDE + 3)
    assert evaluate(make, BatchedBalance(), seeds) == evaluate(make, Balance(), seeds)


@pytest.mark.parametrize("count", [1, 7, 10, 400_000, 1_000_000])
def test_evaluations_differ_in_their_seeds_and_never_reach_those_of_assessments(count):
    different = 1_000_000 // count
    numbers = sorted({0, 1, different - 1, different, 123_456})
    blocks = {number % different: training_seeds(number, count) for number in numbers}
    firsts = {block[0]: block[-1] for block in blocks.values()}
    assert len(firsts) == len(blocks)
    assert all(last == first + count - 1 for first, last in firsts.items())
    assert min(firsts) == TRAINING_SEEDS
    assert max(firsts.values()) < FINAL_SEEDS
    assert training_seeds(different, count) == training_seeds(0, count)


def test_an_episode_is_recorded_as_stepping_by_hand_gives_it():
    env = make()
    env.reset(seed=5)
    total, ended = 0.0, False
    while not ended:
        _, reward, terminated, truncated, info = env.step(0)
        total, ended = total + reward, terminated or truncated
    [episode] = evaluate(make, ConstantPolicy(0), [5])
    assert episode.seed == 5
    assert episode.total == pytest.approx(total)
    assert episode.assessment == info["assessment"]


def test_doing_nothing_drops_the_pole():
    [episode] = evaluate(make, do_nothing(make().action_space), [0])
    assert episode.assessment.length < 15
    assert not episode.assessment.safe


def test_the_random_policy_depends_on_its_seed_only():
    space = gym.spaces.Discrete(1000)
    draws = [[RandomPolicy(space, seed)(None) for _ in range(3)] for seed in (1, 1, 2)]
    assert draws[0] == draws[1] != draws[2]


def test_a_product_of_spaces_has_no_zero_action():
    with pytest.raises(UsageError, match=r"no zero action in a Tuple space"):
        do_nothing(gym.spaces.Tuple((gym.spaces.Discrete(2),)))


def test_zero_is_clipped_to_the_action_space():
    assert do_nothing(gym.spaces.Box(1, 2, (2,))).action == pytest.approx(np.ones(2))


def test_whoever_watches_hears_every_step_and_can_end_it():
    heard = []
    evaluate(make, ConstantPolicy(0), [1, 2, 3], heard.append)
    lengths = [
        episode.assessment.length for episode in evaluate(make, ConstantPolicy(0), [1, 2, 3])
    ]
    assert len(heard) == max(lengths)
    assert (heard[0], heard[-1]) == (0, 3)
    assert heard == sorted(heard)

    def stop(complete):
        if complete == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        evaluate(make, ConstantPolicy(0), [1, 2, 3], stop)


def test_environments_are_closed_however_an_evaluation_ends():
    closed = []

    def watched():
        env = make()
        env.unwrapped.close = lambda: closed.append(env)
        return env

    def fail(observation):
        raise KeyError

    evaluate(watched, ConstantPolicy(0), [1, 2])
    with pytest.raises(KeyError):
        evaluate(watched, fail, [1])
    assert len(closed) == 3


class Endless(gym.Env):
    observation_space = gym.spaces.Box(0, 1, ())
    action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros((), np.float32), {}

    def step(self, action):
        return np.zeros((), np.float32), 0.0, False, False, {}


def test_an_environment_without_a_horizon_needs_one(monkeypatch):
    monkeypatch.setattr(gym.envs.registration, "registry", dict(gym.registry))
    gym.register("Endless-v0", Endless)
    task = hprs.parse_task("signal x = obs in [0, 1]\nensure low: x <= 0.5\n")
    with pytest.raises(UsageError) as error:
        make_environment("Endless-v0", task)
    assert str(error.value) == "Endless-v0 has no horizon of its own. Give it one: --horizon N"
    [episode] = evaluate(
        lambda: make_environment("Endless-v0", task, horizon=7), ConstantPolicy(0), [0]
    )
    assert episode.assessment.length == 7


@pytest.mark.parametrize("step", [0, 96])
def test_ctrl_c_ends_an_evaluation_and_resuming_repeats_it(tmp_path, monkeypatch, step):
    configuration = ppo(evaluation_interval=96, steps=192)
    [whole] = create_runs([configuration], tmp_path / "whole")
    sb3.train(whole)
    [run] = create_runs([configuration], tmp_path / "run")
    watched = evaluation.evaluate

    def press_ctrl_c(make, policy, seeds, watch=None):
        if policy.model.num_timesteps == step:
            os.kill(os.getpid(), signal.SIGINT)
        return watched(make, policy, seeds, watch)

    with monkeypatch.context() as patched:
        patched.setattr(recorder, "evaluate", press_ctrl_c)
        assert not sb3.train(run)
    assert {row["step"] for row in run.evaluations()} == ({0} if step else set())
    assert sb3.train(run)
    assert same_numbers(run, whole)
