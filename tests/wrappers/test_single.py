"""The single-environment wrapper: reward, ends, info and errors."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from hprs.errors import SignalError
from hprs.semantics.assessment import assess
from hprs.semantics.evaluation import evaluate
from hprs.spec.expression import call
from hprs.spec.task import Requirement, Signal, Source, Task
from hprs.wrappers.single import wrap
from tests.probes import Slider, slider_task


def play(env, actions, seed=0):
    steps = [env.reset(seed=seed)]
    for action in actions:
        steps.append(env.step(np.array([action])))
        if steps[-1][2] or steps[-1][3]:
            break
    return steps


def test_the_reward_of_an_episode_sums_to_base_reward_plus_potential_difference():
    env = wrap(Slider(), slider_task())
    (_, start), *steps = play(env, [0.4] * 12)
    assert steps[-1][2]  # the target ends it
    total = sum(step[1] for step in steps)
    assert total == pytest.approx(1.0 + steps[-1][4]["potential"] - start["potential"])


def test_the_assessment_equals_that_of_the_recorded_trace():
    task = slider_task("conquer")
    env = wrap(Slider(), task)
    rng = np.random.default_rng(2)
    for seed in range(20):
        actions = rng.uniform(-1, 1, 12)
        (observation, info), *steps = play(env, actions, seed)
        taken = actions[: len(steps)]
        infos = [info, *(step[4] for step in steps)]
        trace = {
            "x": np.array([observation[0], *(step[0][0] for step in steps)]),
            "progress": np.array([i["lap"]["progress"] for i in infos]),
            "force": np.array([i.get("force", 0.0) for i in infos]),
            "push": np.array([0.0, *taken]),
            "before": np.array([0.0, 0.0, *taken[:-1]]),
        }
        assert steps[-1][4]["assessment"] == assess(task, trace)
        potentials = [i["potential"] for i in infos]
        np.testing.assert_allclose(potentials, evaluate(task, trace).potential, atol=1e-12)


def test_info_carries_margins_scores_potential_original_reward_and_cost():
    env = wrap(Slider(), slider_task(), end_on_violation=False)
    _, *steps = play(env, [-1.0] * 3)
    info = steps[-1][4]
    by_class = ["on_line", "there", "smooth", "gentle"]
    assert list(info["margins"]) == list(info["scores"]) == by_class
    assert info["margins"]["on_line"] < 0.0
    assert info["cost"] == 1.0
    assert info["env_reward"] == pytest.approx(-abs(steps[-1][0][0]))
    assert info["scores"]["on_line"] == 0.0


def test_the_environments_own_reward_passes_unchanged():
    bare = play(Slider(), [0.1] * 5)
    wrapped = play(wrap(Slider(), slider_task(), reward="env"), [0.1] * 5)
    assert [s[1] for s in wrapped[1:]] == [s[1] for s in bare[1:]]


@pytest.mark.parametrize(("switch", "action"), [("end_on_violation", -1.0), ("end_on_target", 1.0)])
def test_each_end_of_the_episode_can_be_switched_off(switch, action):
    ends = play(wrap(Slider(own_end=99), slider_task()), [action] * 12)
    goes_on = play(wrap(Slider(own_end=99), slider_task(), **{switch: False}), [action] * 12)
    assert ends[-1][2] and not ends[-1][3]
    assert len(goes_on) > len(ends)


def test_conquer_is_decided_at_the_horizon():
    steps = play(wrap(Slider(), slider_task("conquer")), [0.5, 0.5, 0.5] + [0.0] * 20)
    assert steps[-1][3] and not steps[-1][2]
    assert steps[-1][4]["assessment"].target


def test_terminated_and_truncated_stay_apart_when_both_happen():
    steps = play(wrap(Slider(horizon=4), slider_task()), [0.45] * 4, seed=3)
    assert steps[-1][3]


def test_an_episode_decided_at_its_start_ends_with_its_first_step_and_says_so():
    x = Signal("x", -3.0, 3.0, source=Source("obs", (), 0))
    task = Task(
        (x,), (Requirement("ensure", "right", x >= 2.9), Requirement("achieve", "up", x >= 2.8))
    )
    steps = play(wrap(Slider(), task), [0.0] * 3)
    assert len(steps) == 2
    assert steps[-1][4]["assessment"].decided_at_start


def test_reset_draws_nothing_from_the_action_space():
    env = wrap(Slider(), slider_task())
    env.action_space.seed(4)
    first = env.action_space.sample()
    env.action_space.seed(4)
    env.reset(seed=0)
    assert env.action_space.sample() == first


def test_wrapping_does_not_disturb_the_environments_generator():
    bare, probed = Slider(), Slider()
    bare.reset(seed=3)
    probed.reset(seed=3)
    wrapped = wrap(probed, slider_task())
    np.testing.assert_array_equal(bare.reset()[0], wrapped.reset()[0])


def test_the_previous_state_is_copied_not_aliased():
    class Reuses(Slider):
        def __init__(self):
            super().__init__()
            self.buffer = np.zeros(2)

        def _observe(self):
            self.buffer[:] = super()._observe()
            return self.buffer

    action = np.array([0.0])
    env, reference = wrap(Reuses(), slider_task()), wrap(Slider(), slider_task())
    env.reset(seed=1)
    reference.reset(seed=1)
    for push in (0.3, -0.2, 0.4, 0.1):
        action[0] = push
        ours = env.step(action)
        ours[0][:] = np.nan
        assert ours[1] == reference.step(np.array([push]))[1]


def test_values_outside_their_range_are_counted_by_signal():
    x = Signal("x", -0.6, 0.6, source=Source("obs", (), 0))
    task = Task((x,), (Requirement("conquer", "here", abs(x) <= 0.1),))
    steps = play(wrap(Slider(own_end=99), task), [1.0] * 12)
    trace = [abs(step[0][0]) > 0.6 for step in steps]
    assert steps[-1][4]["assessment"].outside == {"x": sum(trace)}


@pytest.mark.parametrize(
    ("source", "message"),
    [
        (Source("obs", (), 2), r"signal 'x' reads obs\[2\], but obs has shape \(2,\)"),
        (Source("obs", ("pose",), 0), "signal 'x' reads obs.pose.0., but obs is a Box"),
        (Source("obs"), "signal 'x' is one number, but obs has 2 components"),
        (
            Source("info", ("lapp", "progress")),
            "signal 'x' is missing at reset.*Did you mean 'lap'",
        ),
        (None, "signal 'x' is missing at reset: info has no 'signals'"),
    ],
)
def test_a_wrong_source_fails_when_wrapping_by_name(source, message):
    x = Signal("x", -3.0, 3.0, source=source)
    with pytest.raises(SignalError, match=message):
        wrap(Slider(), Task((x,), (Requirement("conquer", "here", x <= 0),)))


class Room(gym.Env):
    observation_space = spaces.Dict(
        {"pose": spaces.Box(-5.0, 5.0, (3,), np.float32), "wall": spaces.Discrete(2)}
    )
    action_space = spaces.Discrete(3, start=1)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return {"pose": np.array([3.0, 4.0, 0.0], np.float32), "wall": np.int64(0)}, {}

    def step(self, action):
        return (
            {"pose": np.array([0.3, 0.4, 1.0], np.float32), "wall": np.int64(1)},
            0,
            False,
            True,
            {},
        )


def test_dictionaries_slices_and_discrete_actions_are_read():
    position = Signal("position", -5.0, 5.0, source=Source("obs", ("pose",), (0, 2)), length=2)
    wall = Signal("wall", 0.0, 1.0, source=Source("obs", ("wall",)))
    act = Signal("act", 0.0, 3.0, source=Source("action"))
    task = Task(
        (position, wall, act),
        (
            Requirement("ensure", "free", wall < 1),
            Requirement("conquer", "home", call("norm", position) <= 1.0),
            Requirement("encourage", "low", act <= 2),
        ),
    )
    env = wrap(Room(), task, end_on_violation=False)
    _, info = env.reset()
    assert info["margins"] == pytest.approx({"free": 1.0, "home": -4.0, "low": 1.0})
    info = env.step(3)[4]
    assert info["margins"] == pytest.approx({"free": 0.0, "home": 0.5, "low": -1.0}, abs=1e-6)
    assert info["cost"] == 1.0


def test_a_misspelt_key_suggests_the_right_one():
    wall = Signal("wall", 0.0, 1.0, source=Source("obs", ("wal",)))
    with pytest.raises(SignalError, match=r"the observation has no 'wal'. Did you mean 'wall'"):
        wrap(Room(), Task((wall,), (Requirement("ensure", "free", wall < 1),)))


def test_a_function_supplies_signals_over_single_values():
    x = Signal("x", -3.0, 3.0)
    task = Task((x,), (Requirement("conquer", "here", x <= 0),))
    env = wrap(Slider(), task, signals=lambda obs, action, last, info: {"x": obs[0] + action[0]})
    observation, info = env.reset(seed=0)
    assert info["margins"]["here"] == pytest.approx(-observation[0])
    observation, *_, info = env.step(np.array([0.25]))
    assert info["margins"]["here"] == pytest.approx(-observation[0] - 0.25)


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (None, "must return a dictionary from signal to value, got None"),
        ([1.0], r"must return a dictionary from signal to value, got \[1.0\]"),
        (
            {"x": 1.0, "spede": 2.0},
            "'spede', which is no signal of the task. Did you mean 'speed'",
        ),
        ({"x": None, "speed": 1.0}, "signal 'x' must be one number, got None"),
        ({"x": "fast", "speed": 1.0}, "signal 'x' must be one number, got 'fast'"),
        ({"x": [1.0, 2.0], "speed": 1.0}, r"'x' must be one number, got an array of shape \(2,\)"),
        ({"x": 1.0, "speed": 1.0, "wheels": 3.0}, "'wheels' must be 2 numbers, got one number"),
        ({"x": np.nan, "speed": 1.0}, "signal 'x' is NaN at step 0"),
    ],
)
def test_what_a_function_must_not_return_is_refused_when_wrapping(returned, message):
    x, speed, wheels = Signal("x", -3, 3), Signal("speed", 0, 9), Signal("wheels", 0, 9, length=2)
    here = Requirement("conquer", "here", x + speed + call("max", wheels) <= 0)
    ordinary = {"wheels": [1.0, 2.0]}
    with pytest.raises(SignalError, match=message):
        wrap(
            Slider(),
            Task((x, speed, wheels), (here,)),
            signals=lambda *_: ordinary | returned if isinstance(returned, dict) else returned,
        )


def test_a_function_may_supply_signals_that_nothing_uses():
    x, spare = Signal("x", -3.0, 3.0), Signal("spare", -3.0, 3.0)
    task = Task((x, spare), (Requirement("conquer", "here", x <= 0),))
    _, info = wrap(Slider(), task, signals=lambda *_: {"x": 1, "spare": 2}).reset(seed=0)
    assert info["margins"] == {"here": -1.0}


def test_nan_names_signal_and_step():
    class Broken(Slider):
        def _observe(self):
            return super()._observe() * (np.nan if self.steps == 2 else 1.0)

    env = wrap(Broken(), slider_task())
    with pytest.raises(SignalError, match="signal 'x' is NaN at step 2"):
        play(env, [0.0] * 5)


def test_a_nan_margin_names_requirement_and_step():
    x = Signal("x", -3.0, 3.0, source=Source("obs", (), 0))
    steps = Signal("steps", 0.0, 20.0, source=Source("obs", (), 1))
    root = call("sqrt", call("max", x, 0.0) * 0.0 + steps)
    env = wrap(Slider(), Task((x, steps), (Requirement("conquer", "here", root <= 3),)))
    env.reset(seed=0)
    env.unwrapped.steps = -5
    with pytest.raises(SignalError, match="the margin of requirement 'here' is NaN at step 1"):
        env.step(np.array([0.0]))


def test_step_before_reset_is_an_error():
    env = wrap(Slider(), slider_task())
    env.unwrapped.reset(seed=0)
    with pytest.raises(SignalError, match="before reset"):
        env.step(np.array([0.0]))
    assert env.unwrapped.steps == 0  # nothing has been stepped


def test_stable_baselines3_vector_environments_give_the_same_rewards_across_episode_ends():
    vec_env = pytest.importorskip("stable_baselines3.common.vec_env")
    task = slider_task()
    envs = vec_env.DummyVecEnv([lambda: wrap(Slider(), task)] * 3)
    envs.seed(11)
    envs.reset()
    singles = [wrap(Slider(), task) for _ in range(3)]
    for index, env in enumerate(singles):
        env.reset(seed=11 + index)
    rng = np.random.default_rng(0)
    ends = 0
    for _ in range(50):
        actions = rng.uniform(-1, 1, (3, 1)).astype(np.float64)
        _, rewards, dones, infos = envs.step(actions)
        for index, env in enumerate(singles):
            _, reward, terminated, truncated, info = env.step(actions[index])
            assert rewards[index] == pytest.approx(reward, rel=1e-6)
            assert dones[index] == (terminated or truncated)
            if terminated or truncated:
                assert infos[index]["assessment"] == info["assessment"]
                env.reset()
                ends += 1
    assert ends > 6


def test_stable_baselines3_subprocesses_give_what_its_synchronous_environments_give():
    vec_env = pytest.importorskip("stable_baselines3.common.vec_env")
    task = slider_task()
    makes = [lambda: wrap(Slider(), task)] * 2
    ours = vec_env.SubprocVecEnv(makes, start_method="spawn")
    reference = vec_env.DummyVecEnv(makes)
    try:
        for envs in (ours, reference):
            envs.seed(2)
            envs.reset()
        rng = np.random.default_rng(1)
        ends = 0
        for _ in range(40):
            actions = rng.uniform(-1, 1, (2, 1))
            mine, theirs = ours.step(actions), reference.step(actions)
            np.testing.assert_allclose(mine[1], theirs[1])
            np.testing.assert_array_equal(mine[2], theirs[2])
            ends += int(mine[2].sum())
        assert ends > 4
    finally:
        ours.close()


def test_the_signals_of_the_newest_state_can_be_asked_for():
    env = wrap(Slider(), slider_task())
    observation, _ = env.reset(seed=3)
    start = {"x": observation[0], "progress": observation[0] / 2, "force": 0.0, "push": 0.0}
    names = [*start, "before"]
    assert {name: env.signal_values[name] for name in names} == {**start, "before": 0.0}
    env.step(np.array([0.25]))
    observation, *_ = env.step(np.array([0.5]))
    reached = {"x": observation[0], "progress": observation[0] / 2, "force": 0.25, "push": 0.5}
    assert {name: env.signal_values[name] for name in names} == {**reached, "before": 0.25}
