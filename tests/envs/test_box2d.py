"""What the Box2D benchmarks share: episodes that can be played again, and the missing package."""

from __future__ import annotations

import copy
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest

from hprs.envs import BENCHMARKS

IDS = ["hprs/LunarLanderObstacle-v0", "hprs/BipedalWalker-v0", "hprs/BipedalWalkerHardcore-v0"]


def actions(name, seed, count):
    space = gym.make(name).action_space
    # Gentle torques let a walker stand for a while.
    strength = 1.0 if "Lander" in name else 0.3
    return (strength * np.random.default_rng(seed).uniform(-1, 1, (count, *space.shape))).astype(
        np.float32
    )


def play(env, chosen):
    """Everything that these actions lead to, over as many episodes as it takes."""
    seen = [env.reset()[0]]
    for action in chosen:
        observation, reward, terminated, _, _ = env.step(action)
        seen += [observation, [reward, terminated]]
        if terminated:
            seen.append(env.reset()[0])
    return np.concatenate([np.asarray(part, np.float64) for part in seen])


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("seed", range(3))
def test_the_same_seed_gives_the_same_episodes_whatever_the_global_generators(name, seed):
    first, second = gym.make(name).unwrapped, gym.make(name).unwrapped
    chosen = actions(name, seed, 400)
    played = []
    for env, unrelated in ((first, 1), (second, 2)):
        np.random.seed(unrelated)  # noqa: NPY002
        env.reset(seed=seed)
        played.append(play(env, chosen))
    assert np.array_equal(*played)
    assert not np.array_equal(played[0][:200], play(first, chosen)[:200])


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("before", range(1, 5))
def test_a_new_environment_plays_any_episode_again_from_the_generators_state(name, before):
    used, new = gym.make(name).unwrapped, gym.make(name).unwrapped
    used.reset(seed=before)
    for earlier in range(before):
        play(used, actions(name, 100 + earlier, 150))
    state = copy.deepcopy(used.np_random.bit_generator.state)
    new.np_random.bit_generator.state = state
    chosen = actions(name, before, 300)
    assert np.array_equal(play(used, chosen), play(new, chosen))
    assert used.np_random.bit_generator.state == new.np_random.bit_generator.state


def without_box2d(code):
    return subprocess.run(
        [sys.executable, "-c", f"import sys\nsys.modules['Box2D'] = None\n{code}"],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("name", IDS)
def test_a_missing_box2d_names_the_extra(name):
    found = without_box2d(f"import gymnasium, hprs.envs\ngymnasium.make('{name}')")
    assert found.stderr.strip().splitlines()[-1] == (
        "hprs.errors.MissingExtraError: Box2D is not installed. "
        "Install it with: pip install 'hprs[box2d]'"
    )


def test_the_command_line_names_the_extra_in_one_line():
    found = without_box2d(
        f"from hprs.cli import main\nsys.exit(main(['evaluate', '{IDS[0]}', '--policy', 'zero']))"
    )
    assert found.returncode == 2
    assert found.stderr == (
        "hprs: Box2D is not installed. Install it with: pip install 'hprs[box2d]'\n"
    )


def test_tasks_are_listed_and_read_without_box2d():
    found = without_box2d(
        "import hprs, hprs.envs\n"
        "print(*(task for b in hprs.envs.BENCHMARKS.values() for task in b.task.labels))"
    )
    assert found.stderr == ""
    assert found.stdout.split() == [
        label for benchmark in BENCHMARKS.values() for label in benchmark.task.labels
    ]
