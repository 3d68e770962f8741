import gymnasium as gym
import numpy as np
import pytest

from hprs.envs import task_of
from hprs.errors import UsageError
from hprs.training import evaluation
from hprs.training.environment import make_environment
from hprs.training.evaluation import episode_seeds, evaluate
from hprs.training.policies import ConstantPolicy, RandomPolicy, do_nothing

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


def test_an_episode_without_end_is_given_up(monkeypatch):
    monkeypatch.setattr(evaluation, "LONGEST_EPISODE", 3)
    with pytest.raises(UsageError, match=r"did not end within 3 steps.*--horizon"):
        evaluate(make, ConstantPolicy(0), [0])
