import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import hprs.envs
from hprs.envs import BENCHMARKS, register, task_of, task_text_of
from hprs.envs.registration import benchmark_of


def test_registering_twice_changes_nothing():
    before = dict(gym.registry)
    register()
    assert gym.registry == before


def test_an_id_that_names_the_package_needs_no_import():
    program = (
        "import gymnasium as gym\n"
        "env = gym.make('hprs.envs:hprs/CartPole-v0')\n"
        "assert env.spec.id == 'hprs/CartPole-v0'\n"
        "assert gym.make_vec('hprs.envs:hprs/CartPole-v0', 2).num_envs == 2\n"
    )
    found = subprocess.run(
        [sys.executable, "-W", "error", "-c", program], capture_output=True, text=True, check=False
    )
    assert (found.returncode, found.stderr) == (0, "")


@pytest.mark.parametrize("name", BENCHMARKS)
def test_a_benchmark_is_made_by_its_id_and_ends_at_its_horizon(name):
    assert gym.spec(name).max_episode_steps == BENCHMARKS[name].horizon


@pytest.mark.filterwarnings("ignore:.*observation space m.*imum value is")
@pytest.mark.parametrize("name", BENCHMARKS)
def test_a_benchmark_is_a_valid_environment(name):
    check_env(gym.make(name, disable_env_checker=True).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("name", BENCHMARKS)
def test_the_same_seed_gives_the_same_episode(name):
    def episode():
        env = gym.make(name)
        observations = [env.reset(seed=3)[0]]
        env.action_space.seed(3)
        for _ in range(5):
            observations.append(env.step(env.action_space.sample())[0])
        return np.array(observations)

    assert np.array_equal(episode(), episode())


@pytest.mark.parametrize("name", BENCHMARKS)
def test_a_benchmark_has_a_task_without_remarks(name):
    task = task_of(name)
    assert task is not None
    assert task.remarks == ()
    assert hprs.parse_task(task_text_of(name)) == task


@pytest.mark.parametrize("name", BENCHMARKS)
def test_an_id_with_its_module_is_the_same_benchmark(name):
    from hprs.training.algorithms import tuning_of
    from hprs.training.environment import find_task

    named = f"hprs.envs:{name}"
    assert benchmark_of(named) is BENCHMARKS[name]
    assert find_task(named) == find_task(name)
    assert tuning_of(named) == tuning_of(name)


def test_an_environment_that_is_not_ours_has_no_task():
    assert task_of("CartPole-v1") is None
    assert task_text_of("CartPole-v1") is None
    assert benchmark_of("gymnasium:CartPole-v1") is None


def test_the_vectorised_cart_pole_agrees_with_the_single_one():
    single, vector = gym.make("hprs/CartPole-v0"), gym.make_vec("hprs/CartPole-v0", num_envs=1)
    assert type(vector.unwrapped).__name__ == "CartPoleVectorEnv"
    observation, _ = single.reset(seed=1)
    vector.reset(seed=1)
    vector.unwrapped.state = np.array(observation)[:, None]
    for action in (0, 1, 1):
        one, reward, *_ = single.step(action)
        many, rewards, *_ = vector.step(np.array([action]))
        assert np.allclose(one, many[0], atol=1e-6)
        assert reward == rewards[0] == 1.0


def test_the_cart_pole_moves_by_fiftieths_of_a_second():
    assert gym.make("hprs/CartPole-v0").unwrapped.tau == 0.02
