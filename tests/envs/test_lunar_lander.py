"""The lander: Gymnasium's physics, the obstacle, episodes that a landing does not end."""

from __future__ import annotations

import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.box2d import LunarLander

import hprs
from hprs.envs import task_of
from hprs.envs.lunar_lander.env import LunarLanderObstacle
from hprs.envs.lunar_lander.pilot import fly
from hprs.errors import UsageError
from hprs.semantics.evaluation import scores

ID = "hprs/LunarLanderObstacle-v0"
FAR_AWAY = (1.5, 1.6)
IDLE = np.zeros(2, np.float32)


def actions(seed, count):
    return np.random.default_rng(seed).uniform(-1, 1, (count, 2)).astype(np.float32)


def landing(seed=0, **options):
    """The steps of an episode of the pilot, with the task."""
    env = hprs.wrap(gym.make(ID, **options), task_of(ID))
    observation, _ = env.reset(seed=seed)
    steps = []
    while not steps or not (steps[-1][2] or steps[-1][3]):
        steps.append(env.step(fly(observation)))
        observation = steps[-1][0]
    return steps


def hover_over(observation, height):
    """The pilot, told that the ground is this much higher and that nothing is in its way."""
    told = observation.copy()
    told[1] -= height
    told[8:12] = 2.0, 2.1, 5.1, 5.0
    return fly(told)


@pytest.mark.parametrize("seed", range(8))
def test_without_offset_and_contact_it_is_gymnasiums_lander_bit_for_bit(seed):
    ours, theirs = LunarLanderObstacle(obstacle=FAR_AWAY, x_offset=0), LunarLander(continuous=True)
    assert np.array_equal(ours.reset(seed=seed)[0][:8], theirs.reset(seed=seed)[0])
    for action in actions(seed, 300):
        observation, reward, terminated, *_ = ours.step(action)
        their_observation, their_reward, their_end, *_ = theirs.step(action)
        assert np.array_equal(observation[:8], their_observation)
        assert (reward, terminated) == (their_reward, their_end)
        if terminated:
            break
    assert terminated


def test_the_offset_moves_the_start_and_nothing_else():
    for seed in range(5):
        ours, theirs = LunarLanderObstacle(obstacle=FAR_AWAY), LunarLander(continuous=True)
        moved, at = ours.reset(seed=seed)[0], theirs.reset(seed=seed)[0]
        shift = moved[0] - at[0]
        assert np.allclose(moved[1:8], at[1:], atol=1e-5)
        assert abs(shift) <= 0.1
        theirs.np_random.bit_generator.state = ours.np_random.bit_generator.state
        for action in actions(seed, 40):
            moved, at = ours.step(action)[0], theirs.step(action)[0]
            assert np.allclose(moved[:8] - [shift, *7 * [0]], at, atol=1e-3)


def test_starts_fill_the_offset_evenly():
    env = LunarLanderObstacle()
    env.reset(seed=0)
    starts = []
    for _ in range(300):
        observation, _ = env.reset()
        # Reset plays one frame of 0.02 s; vx = 1 are 5 units a second, x = 1 are 10 units.
        starts.append(observation[0] - observation[2] * 5 * 0.02 / 10)
    assert -0.1005 < min(starts) < -0.095
    assert 0.095 < max(starts) < 0.1005
    assert abs(np.mean(starts)) < 0.01


def test_the_obstacle_is_where_the_observation_says():
    env = LunarLanderObstacle()
    observation, _ = env.reset(seed=0)
    assert observation[8:12] == pytest.approx([0.0, 0.2, 0.53, 0.46])
    assert env.observation_space.contains(observation)
    [fixture] = env.drawlist[-1].fixtures
    corners = np.array([fixture.body.transform * vertex for vertex in fixture.shape.vertices])
    # The world is 20 x 13.33 units; the pad's origin lies at x = 10, y = 13.33 / 4 + 0.6.
    x, y = (corners[:, 0] - 10) / 10, (corners[:, 1] - 40 / 12 - 0.6) / (20 / 3)
    assert (x.min(), x.max()) == pytest.approx((0.0, 0.2), abs=1e-6)
    assert (y.min(), y.max()) == pytest.approx((0.46, 0.53), abs=1e-6)


def test_the_published_runs_obstacle_is_one_option_away():
    observation, _ = gym.make(ID, obstacle=(-0.1, 0.1)).reset(seed=0)
    assert observation[8:12] == pytest.approx([-0.1, 0.1, 0.53, 0.46])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"obstacle": (0.2, 0.0)},
            "obstacle needs two numbers in [-2.5, 2.5], the smaller one first",
        ),
        ({"obstacle": 0.1}, "obstacle needs two numbers"),
        ({"obstacle": (0.0, 0.1, 0.2)}, "obstacle needs two numbers"),
        (
            {"obstacle": "01"},
            "obstacle needs two numbers in [-2.5, 2.5], the smaller one first, got '01'.",
        ),
        ({"obstacle": ["0", "1"]}, "obstacle needs two numbers"),
        ({"obstacle": (False, True)}, "obstacle needs two numbers"),
        ({"x_offset": "a"}, "x_offset needs a number, got 'a'."),
        ({"x_offset": None}, "x_offset needs a number, got None."),
        ({"x_offset": True}, "x_offset needs a number, got True."),
        ({"x_offset": 10**400}, "x_offset needs a number, got 1000"),
        ({"x_offset": float("nan")}, "x_offset must lie in [0, 1), got nan."),
        ({"obstacle_heights": (0.53, 0.46)}, "obstacle_heights needs two numbers"),
        ({"obstacle_heights": (0.4, float("nan"))}, "obstacle_heights needs two numbers"),
        ({"x_offset": -0.1}, "x_offset must lie in [0, 1), got -0.1."),
    ],
)
def test_wrong_options_are_refused(options, message):
    with pytest.raises(UsageError) as error:
        gym.make(ID, **options)
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("obstacle", "heights", "refused"),
    [
        ((-0.9, 0.9), (1.3, 1.6), True),
        ((0.2, 0.4), (1.3, 1.6), True),
        ((-0.4, -0.2), (1.3, 1.6), True),
        ((-0.1, 0.1), (1.5, 1.6), True),
        ((0.23, 0.4), (1.3, 1.6), False),
        ((-0.4, -0.23), (1.3, 1.6), False),
        ((-0.9, 0.9), (1.2, 1.3), False),
        ((-0.9, 0.9), (1.53, 1.6), False),
    ],
)
def test_an_obstacle_where_the_lander_starts_is_refused_and_no_other(obstacle, heights, refused):
    options = {"obstacle": obstacle, "obstacle_heights": heights}
    if refused:
        with pytest.raises(UsageError, match=r"the obstacle reaches where the lander starts, x in"):
            LunarLanderObstacle(**options)
        return
    env = LunarLanderObstacle(**options)
    for seed in range(40):
        assert env.reset(seed=seed)[0][12] == 0


def test_touching_the_obstacle_with_the_body_ends_the_episode_as_the_ground_does():
    heights = []
    for options in ({"obstacle": (-0.4, 0.4)}, {"obstacle": FAR_AWAY}):
        env = gym.make(ID, **options)
        observation, _ = env.reset(seed=0)
        terminated = False
        while not terminated:
            assert observation[12] == 0
            observation, reward, terminated, truncated, _ = env.step(IDLE)
            assert not truncated
        assert observation[12] == 1
        assert reward == -100
        heights.append(observation[1])
    on_obstacle, on_ground = heights
    assert 0.5 < on_obstacle < 0.7
    assert on_ground < 0.1


def test_the_task_counts_the_touch_as_unsafe_and_as_no_landing():
    env = hprs.wrap(gym.make(ID, obstacle=(-0.4, 0.4)), task_of(ID))
    env.reset(seed=0)
    terminated = False
    while not terminated:
        _, _, terminated, _, info = env.step(IDLE)
    assert info["margins"]["no_collision"] == -0.5
    assert not info["assessment"].satisfied
    assert not info["assessment"].safe


def test_standing_on_the_obstacle_with_the_legs_is_neither_a_collision_nor_a_landing():
    env = hprs.wrap(gym.make(ID, obstacle=(-0.6, 0.6), x_offset=0), task_of(ID))
    observation, _ = env.reset(seed=3)
    truncated = False
    while not truncated:
        action = hover_over(observation, 0.53)
        observation, _, terminated, truncated, info = env.step(action)
        assert not terminated
    assert observation[6:8].tolist() == [1, 1]
    assert observation[12] == 0
    # Its centre is 0.094 above what it stands on.
    assert observation[1] == pytest.approx(0.53 + 0.094, abs=0.002)
    assert info["assessment"].safe
    assert not info["assessment"].target


@pytest.mark.parametrize("obstacle", [(0.0, 0.2), (-0.1, 0.1)])
@pytest.mark.parametrize("seed", range(5))
def test_the_pilot_lands_beside_the_obstacle_and_stays(obstacle, seed):
    steps = landing(seed, obstacle=obstacle)
    observation, _, terminated, truncated, info = steps[-1]
    assert len(steps) == 600
    assert (terminated, truncated) == (False, True)
    assert info["assessment"].safe
    assert info["assessment"].target
    # What docs/paper.md says about the height of a lander at rest.
    assert -0.003 < observation[1] < 0.001


def test_a_lander_that_sleeps_stays_until_the_horizon_and_is_paid_once():
    steps = landing()
    rewards = [step[4]["env_reward"] for step in steps]
    [asleep] = [index for index, reward in enumerate(rewards) if reward == 100]
    assert asleep < 590
    assert set(rewards[asleep + 1 :]) == {0.0}


def test_a_lander_that_wakes_and_sleeps_again_is_not_paid_again():
    env = gym.make(ID, max_episode_steps=2000)
    observation, _ = env.reset(seed=0)
    paid, wakings, was_awake = 0, 0, True
    for step in range(2000):
        awake = env.unwrapped.lander.awake
        action = fly(observation)
        if not awake and wakings == 0:
            # The side engine nudges it without lifting it.
            action, wakings = np.array([0, 1], np.float32), 1
        observation, reward, terminated, *_ = env.step(action)
        paid += reward == 100
        assert not terminated, step
        was_awake = awake
    assert wakings == 1
    assert not was_awake
    assert paid == 1


def test_leaving_the_world_is_unsafe_and_ends_the_episode():
    env = hprs.wrap(gym.make(ID), task_of(ID))
    env.reset(seed=0)
    terminated = False
    while not terminated:
        # Lean to the right with the main engine on.
        angle = env.unwrapped.lander.angle
        action = np.array([0.8, 1 if angle < -0.3 else -1 if angle > -0.2 else 0], np.float32)
        observation, _, terminated, truncated, info = env.step(-action * [-1, 1])
        assert not truncated
    assert abs(observation[0]) >= 1
    assert not info["assessment"].safe
    assert info["assessment"].requirements["no_collision"]
    assert observation[12] == 0


def test_drawing_shows_the_obstacle_and_changes_nothing():
    drawn, plain = gym.make(ID, render_mode="rgb_array"), gym.make(ID)
    observation, _ = drawn.reset(seed=0)
    plain.reset(seed=0)
    for _ in range(250):
        action = fly(observation)
        observation = drawn.step(action)[0]
        assert np.array_equal(observation, plain.step(action)[0])
    picture = drawn.render()
    assert picture.shape == (400, 600, 3)
    # Its middle: x = 0.1, y = 0.495 above the pad's origin, 118 pixels above the bottom.
    assert picture[400 - 118 - round(0.495 * 200), 300 + 30].tolist() == [204, 41, 41]


def test_a_window_shows_the_obstacle_from_the_first_frame(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = gym.make(ID, render_mode="human")
    env.reset(seed=0)
    assert env.unwrapped.screen.get_at((330, 183))[:3] == (204, 41, 41)
    env.close()


def test_a_copy_by_pickle_has_the_same_options():
    env = LunarLanderObstacle(obstacle=(-0.1, 0.1), obstacle_heights=(0.4, 0.5), x_offset=0.05)
    copy = pickle.loads(pickle.dumps(env))
    assert np.array_equal(copy.reset(seed=5)[0], env.reset(seed=5)[0])
    assert copy.render_mode is None


BASE = {"x": 0.0, "y": 0.0, "angle": 0.0, "spin": 0.0, "collision": 0.0}


@pytest.mark.parametrize(
    ("state", "label", "margin", "score"),
    [
        ({"collision": 0.0}, "no_collision", 0.5, 1.0),
        ({"collision": 1.0}, "no_collision", -0.5, 0.0),
        ({"x": -0.75}, "in_world", 0.25, 1.0),
        ({"x": -1.05}, "in_world", -0.05, 0.0),
        # The pad is the segment |x| <= 0.15 at y = 0; beyond its end the distance is Euclidean.
        ({"x": 0.15, "y": -0.004}, "landed", 0.006, 1.0),
        ({"x": 0.45, "y": 0.4}, "landed", 0.01 - 0.5, 1 - 0.49 / (np.hypot(0.95, 1.5) - 0.01)),
        ({"x": 1.1, "y": 1.5}, "landed", 0.01 - np.hypot(0.95, 1.5), 0.0),
        ({"angle": -np.pi / 3 + 0.1}, "upright", 0.1, 1.0),
        ({"angle": 2 * np.pi / 3}, "upright", -np.pi / 3, 0.5),
        ({"spin": -0.4}, "no_spin", 0.1, 1.0),
        ({"spin": 0.75}, "no_spin", -0.25, 0.5),
        ({"spin": -1.5}, "no_spin", -1.0, 0.0),
    ],
)
def test_margins_and_scores_in_closed_form(state, label, margin, score):
    task = task_of(ID)
    assert task.margins({**BASE, **state})[label] == pytest.approx(margin)
    assert scores(task, {**BASE, **state})[label] == pytest.approx(score)


def test_bounds_in_closed_form():
    assert {label: pytest.approx(bounds) for label, bounds in task_of(ID).bounds.items()} == {
        "no_collision": (-0.5, 0.5),
        "in_world": (-0.1, 1.0),
        "landed": (0.01 - np.hypot(0.95, 1.5), 0.01),
        "upright": (-2 * np.pi / 3, np.pi / 3),
        "no_spin": (-0.5, 0.5),
    }
