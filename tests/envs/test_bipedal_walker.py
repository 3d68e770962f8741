"""The walkers: Gymnasium's, until the goal."""

from __future__ import annotations

import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs import box2d
from gymnasium.envs.box2d.bipedal_walker import BipedalWalkerHeuristics

import hprs
from hprs.envs import BENCHMARKS, task_of
from hprs.envs.bipedal_walker.env import FIELD_END, BipedalWalker
from hprs.errors import UsageError
from hprs.semantics.evaluation import scores

ID, HARDCORE = "hprs/BipedalWalker-v0", "hprs/BipedalWalkerHardcore-v0"
IDLE = np.zeros(4, np.float32)


def heuristic():
    """Gymnasium's own walker: it has memory, so one for each episode."""
    walker = BipedalWalkerHeuristics()
    walker.a = np.zeros(4)
    return walker.step_heuristic


def walk(env, seed=0):
    """The steps of an episode of Gymnasium's heuristic, from reset to the end."""
    act, steps = heuristic(), [(*env.reset(seed=seed)[:1], 0.0, False, False, {})]
    while not (steps[-1][2] or steps[-1][3]):
        steps.append(env.step(act(steps[-1][0])))
    return steps


@pytest.mark.parametrize("hardcore", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_it_is_gymnasiums_walker_bit_for_bit_until_the_goal(hardcore, seed):
    # In a new environment: Gymnasium's next episode would depend on its last one.
    ours, theirs = BipedalWalker(hardcore=hardcore), box2d.BipedalWalker(hardcore=hardcore)
    observation = ours.reset(seed=seed)[0]
    assert np.array_equal(observation, theirs.reset(seed=seed)[0])
    act, terminated, steps = heuristic(), False, 0
    while not terminated:
        action = act(observation)
        observation, reward, terminated, truncated, info = ours.step(action)
        their_observation, their_reward, their_end, *_ = theirs.step(action)
        steps += 1
        assert np.array_equal(observation, their_observation)
        assert reward == their_reward
        assert not truncated
        if info["signals"]["progress"] < 1:
            assert terminated == their_end
    assert steps > 20


def test_the_two_benchmarks_share_one_task():
    assert BENCHMARKS[ID].task_text == BENCHMARKS[HARDCORE].task_text
    assert not gym.make(ID).unwrapped.hardcore
    assert gym.make(HARDCORE).unwrapped.hardcore


def test_the_goal_ends_the_episode_and_meets_the_task():
    env = hprs.wrap(gym.make(ID), task_of(ID))
    steps = walk(env)
    _, _, terminated, truncated, info = steps[-1]
    assert (terminated, truncated) == (True, False)
    assert info["assessment"].safe
    assert info["assessment"].target
    assert env.unwrapped.hull.position.x >= 27.7
    assert info["margins"]["goal"] == env.unwrapped.hull.position.x / 27.7 - 1
    assert all(step[4]["margins"]["goal"] < 0 for step in steps[1:-1])


def test_the_bare_environment_ends_at_its_own_goal_too():
    env = gym.make(ID, goal=8.0)
    steps = walk(env)
    assert steps[-1][2]
    assert 8.0 <= env.unwrapped.hull.position.x < 8.2
    assert steps[-1][4]["signals"]["progress"] >= 1 > steps[-2][4]["signals"]["progress"]


def test_progress_is_the_hulls_place_from_the_reset_on():
    env = gym.make(ID, goal=50.0)
    _, info = env.reset(seed=0)
    # The hull starts at 10 terrain steps of 14/30.
    assert info["signals"] == {
        "progress": pytest.approx(14 / 3 / 50, rel=0.01),
        "hull_contact": 0.0,
    }


@pytest.mark.parametrize("name", [ID, HARDCORE])
def test_falling_is_a_violation_and_ends_the_episode(name):
    env = hprs.wrap(gym.make(name), task_of(name))
    env.reset(seed=0)
    terminated = False
    while not terminated:
        _, _, terminated, truncated, info = env.step(np.array([1, -1, 1, -1], np.float32))
        assert not truncated
    assert info["signals"]["hull_contact"] == 1
    assert info["margins"]["no_fall"] == -0.5
    assert info["env_reward"] == -100
    assert not info["assessment"].safe
    # The next episode starts on its legs.
    assert env.reset()[1]["signals"]["hull_contact"] == 0


def test_leaving_the_field_backwards_ends_the_episode_as_in_gymnasium():
    env = gym.make(ID)
    env.reset(seed=0)
    bare = env.unwrapped
    for body in (bare.hull, *bare.legs):
        body.position = (body.position.x - 5.0, body.position.y)
    _, reward, terminated, _, info = env.step(IDLE)
    assert (reward, terminated) == (-100, True)
    assert info["signals"]["hull_contact"] == 0
    assert info["signals"]["progress"] < 0


@pytest.mark.parametrize("goal", [-1.0, 4.0, FIELD_END + 0.1, 93.0, float("nan")])
def test_a_goal_off_the_field_is_refused(goal):
    with pytest.raises(UsageError, match=r"goal must lie beyond the start at 4\.67 .* 88\.67, got"):
        gym.make(ID, goal=goal)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"goal": "abc"}, "goal needs a number, got 'abc'."),
        ({"goal": [30]}, "goal needs a number, got [30]."),
        ({"goal": True}, "goal needs a number, got True."),
        ({"hardcore": "no"}, "hardcore needs true or false, got 'no'."),
    ],
)
def test_options_of_the_wrong_kind_are_refused(options, message):
    with pytest.raises(UsageError) as error:
        gym.make(ID, **options)
    assert str(error.value) == message


def test_the_evaluation_of_the_released_code_is_two_options_away():
    env = gym.make(ID, goal=55.4, max_episode_steps=1000)
    assert env.unwrapped.goal == 55.4
    env.reset(seed=0)
    assert env.spec.max_episode_steps == 1000


def test_a_vector_of_walkers_supplies_the_signals():
    task = task_of(ID)
    envs = hprs.wrap_vector(gym.make_vec(ID, 2, vectorization_mode="sync"), task)
    envs.reset(seed=0)
    infos = envs.step(np.zeros((2, 4), np.float32))[4]
    singles = []
    for seed in (0, 1):
        env = hprs.wrap(gym.make(ID), task)
        env.reset(seed=seed)
        singles.append(env.step(IDLE)[4]["margins"]["goal"])
    assert infos["margins"]["goal"].tolist() == singles
    envs.close()


def test_a_copy_by_pickle_has_the_same_options():
    env = BipedalWalker(hardcore=True, goal=40.0)
    copy = pickle.loads(pickle.dumps(env))
    assert (copy.goal, copy.hardcore) == (40.0, True)
    assert np.array_equal(copy.reset(seed=5)[0], env.reset(seed=5)[0])


BASE = {
    "progress": 0.5,
    "hull_contact": 0.0,
    "angle": 0.0,
    "angular_velocity": 0.0,
    "vx": 0.3,
    "vy": 0.0,
}


@pytest.mark.parametrize(
    ("state", "label", "margin", "score"),
    [
        ({"hull_contact": 0.0}, "no_fall", 0.5, 1.0),
        ({"hull_contact": 1.0}, "no_fall", -0.5, 0.0),
        ({"progress": 0.25}, "goal", -0.75, 0.25),
        ({"progress": 1.0}, "goal", 0.0, 1.0),
        ({"progress": -0.1}, "goal", -1.1, 0.0),
        ({"angle": -np.pi / 36}, "level", 0.0, 1.0),
        ({"angle": 0.5}, "level", np.pi / 36 - 0.5, 0.5 / (1 - np.pi / 36)),
        ({"angular_velocity": -0.2}, "no_swing", 0.05, 1.0),
        ({"angular_velocity": 0.5}, "no_swing", -0.25, 2 / 3),
        ({"vy": -0.1}, "no_bounce", 0.0, 1.0),
        ({"vy": 0.55}, "no_bounce", -0.45, 0.5),
        ({"vx": 0.45}, "fast", 0.15, 1.0),
        ({"vx": 0.15}, "fast", -0.15, 0.5),
        ({"vx": -0.4}, "fast", -0.3, 0.0),
    ],
)
def test_margins_and_scores_in_closed_form(state, label, margin, score):
    task = task_of(ID)
    assert task.margins({**BASE, **state})[label] == pytest.approx(margin, abs=1e-12)
    assert scores(task, {**BASE, **state})[label] == pytest.approx(score)


def test_bounds_in_closed_form():
    assert {label: pytest.approx(bounds) for label, bounds in task_of(ID).bounds.items()} == {
        "no_fall": (-0.5, 0.5),
        "goal": (-1.0, 0.1),
        "level": (np.pi / 36 - 1, np.pi / 36),
        "no_swing": (-0.75, 0.25),
        "no_bounce": (-0.9, 0.1),
        "fast": (-0.3, 0.7),
    }
