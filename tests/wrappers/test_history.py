"""Histories in flat observations, and actions that are changes."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env

import hprs
from hprs.errors import UsageError
from hprs.training.episode_log import EpisodeLog, EpisodeState
from hprs.wrappers import ActionHistory, IncrementAction, ObservationHistory

from ..probes import Slider, slider_task


class Echo(gym.Env):
    """Answers with the number of the step and what it was told."""

    def __init__(self, low=-1.0, high=3.0):
        self.observation_space = spaces.Box(-9.0, 9.0, (3,), np.float32)
        self.action_space = spaces.Box(low, high, (2,), np.float32)
        self.steps = 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.steps = 0
        return np.zeros(3, np.float32), {}

    def step(self, action):
        self.steps += 1
        return np.array([self.steps, *action], np.float32), 0.0, False, False, {}


def test_the_last_actions_stand_in_front_the_oldest_first():
    env = ActionHistory(Echo(), 2)
    assert env.reset()[0].tolist() == [0, 0, 0, 0, 0, 0, 0]
    assert env.step(np.array([1, 2], np.float32))[0].tolist() == [0, 0, 1, 2, 1, 1, 2]
    assert env.step(np.array([3, 0], np.float32))[0].tolist() == [1, 2, 3, 0, 2, 3, 0]
    assert env.reset()[0].tolist() == [0] * 7
    assert env.observation_space.low.tolist() == [-1] * 4 + [-9] * 3
    assert env.observation_space.high.tolist() == [3] * 4 + [9] * 3


def test_the_first_actions_may_be_said_and_are_zero_within_the_space_otherwise():
    assert ActionHistory(Echo(1.0, 3.0), 1).reset()[0].tolist()[:2] == [1, 1]
    assert ActionHistory(Echo(), 1, start=[2, -1]).reset()[0].tolist()[:2] == [2, -1]


def test_an_action_that_the_caller_changes_later_is_remembered_as_it_was():
    env, action = ActionHistory(Echo(), 1), np.array([1, 2], np.float32)
    env.reset()
    env.step(action)
    action[:] = 0
    assert env._actions.tolist() == [[1, 2]]


def test_parts_of_the_observation_are_repeated_the_oldest_first():
    env = ObservationHistory(Echo(), 3, indices=[0])
    zeros = np.zeros(2, np.float32)
    assert env.reset()[0].tolist() == [0, 0, 0, 0, 0]
    env.step(zeros)
    assert env.step(np.array([1, 2], np.float32))[0].tolist() == [1, 2, 0, 1, 2]
    assert env.step(zeros)[0].tolist() == [0, 0, 1, 2, 3]
    assert env.reset()[0].tolist() == [0] * 5


def test_all_of_the_observation_is_repeated_unless_said_otherwise_as_gymnasium_stacks_it():
    ours = ObservationHistory(Echo(), 3)
    theirs = gym.wrappers.FrameStackObservation(Echo(), 3, padding_type="reset")
    pairs = [(ours.reset()[0], theirs.reset()[0])]
    for number in range(4):
        action = np.full(2, number / 2, np.float32)
        pairs.append((ours.step(action)[0], theirs.step(action)[0]))
    for mine, yours in pairs:
        assert mine.tolist() == yours.ravel().tolist()


def test_a_component_of_the_action_becomes_a_change_within_the_environments_space():
    env = IncrementAction(Echo(), 0, step=0.75)
    assert env.action_space.low.tolist() == [-1, -1]
    assert env.action_space.high.tolist() == [1, 3]
    env.reset()
    told = [env.step(np.array([change, 2], np.float32)) for change in (1, 1, 0.5, 9, 1, -1)]
    assert [step[0][1] for step in told] == [0.75, 1.5, 1.875, 2.625, 3, 2.25]
    assert all(step[0][2] == 2 for step in told)
    assert told[-1][4]["command"].tolist() == [2.25, 2]
    env.reset()
    assert env.step(np.zeros(2, np.float32))[0][1] == 0


def test_a_change_starts_where_it_is_told_to():
    env = IncrementAction(Echo(), 1, step=0.5, start=2.0)
    env.reset()
    assert env.step(np.array([0, -1], np.float32))[0][2] == 1.5


def test_a_task_below_reads_the_commands_not_the_changes():
    env = IncrementAction(hprs.wrap(Slider(), slider_task()), 0, step=0.25)
    env.reset(seed=0)
    margins = [env.step(np.array([1.0]))[4]["margins"] for _ in range(3)]
    assert [m["smooth"] for m in margins] == [0.25] * 3
    assert [m["gentle"] for m in margins] == [0.1875, 0.0, -0.3125]


@pytest.mark.parametrize(
    "wrapped",
    [
        lambda: ActionHistory(Slider(), 3),
        lambda: ObservationHistory(Slider(), 3, indices=[0]),
        lambda: IncrementAction(Slider(), 0, step=0.1),
        lambda: ActionHistory(ObservationHistory(IncrementAction(Slider(), 0, step=0.1), 2), 3),
    ],
)
@pytest.mark.filterwarnings("ignore:.*different from the unwrapped")
def test_what_they_make_is_a_valid_environment_that_can_be_replayed(wrapped):
    check_env(wrapped(), skip_render_check=True)
    env, other = EpisodeLog(wrapped()), EpisodeLog(wrapped())
    env.reset(seed=3)
    for action in ([0.5], [-0.25], [0.125]):
        env.step(np.array(action))
    state = env.state()
    assert other.replay(EpisodeState(actions=state.actions, **state.to_json())) == ""
    one, another = env.step(np.array([0.5])), other.step(np.array([0.5]))
    assert np.array_equal(one[0], another[0])


class Discrete(Echo):
    def __init__(self):
        super().__init__()
        self.action_space = self.observation_space = spaces.Discrete(3)


class Picture(Echo):
    def __init__(self):
        super().__init__()
        self.observation_space = spaces.Box(0.0, 1.0, (4, 4))
        self.action_space = spaces.Box(0.0, 1.0, (4, 4))


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: ActionHistory(Echo(), 0), "length is a whole number from 1 on, not 0"),
        (lambda: ActionHistory(Echo(), 2.0), "length is a whole number"),
        (lambda: ActionHistory(Echo(), True), "length is a whole number"),
        (lambda: ActionHistory(Echo(), 2, start=[9, 9]), r"start is an action of Box"),
        (lambda: ActionHistory(Echo(), 2, start=[0]), r"start is an action of Box"),
        (lambda: ActionHistory(Discrete(), 2), "observations that are a Box, got a Discrete"),
        (lambda: ActionHistory(Picture(), 2), r"observations of one axis, got shape \(4, 4\)"),
        (lambda: ActionHistory("CartPole-v1", 2), "an environment is needed here"),
        (lambda: ObservationHistory(Echo(), -1), "length is a whole number"),
        (lambda: ObservationHistory(Echo(), 2, indices=[3]), "from 0 to 2, not"),
        (lambda: ObservationHistory(Echo(), 2, indices=[1, 1]), "different whole numbers"),
        (lambda: ObservationHistory(Picture(), 2), "observations of one axis"),
        (lambda: IncrementAction(Echo(), 2, step=0.1), "from 0 to 1: 2"),
        (lambda: IncrementAction(Echo(), -1, step=0.1), "from 0 to 1: -1"),
        (lambda: IncrementAction(Echo(), 0, step=0), "step is a finite number above 0, not 0"),
        (lambda: IncrementAction(Echo(), 0, step=float("nan")), "step is a finite number"),
        (lambda: IncrementAction(Echo(), 0, step=1, start=4), r"start lies in \[-1, 3\], not 4"),
        (lambda: IncrementAction(Discrete(), 0, step=1), "actions that are a Box, got a Discrete"),
    ],
)
def test_a_wrong_argument_is_one_clear_error(build, message):
    with pytest.raises(UsageError, match=message):
        build()


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ([np.nan, 0], "An action is finite; component 0 is nan."),
        ([0, np.nan], "An action is finite; component 1 is nan."),
        ([0, -np.inf], "An action is finite; component 1 is -inf."),
        ([0], "An action has shape (2,), not (1,)."),
        ([[0, 0]], "An action has shape (2,), not (1, 2)."),
    ],
)
def test_a_change_that_is_none_is_refused_and_forgotten(action, message):
    env = IncrementAction(Echo(), 0, step=1.0)
    env.reset()
    with pytest.raises(UsageError) as caught:
        env.step(np.array(action, np.float32))
    assert str(caught.value) == message
    assert env.step(np.zeros(2, np.float32))[0][1] == 0


def test_actions_outside_their_space_are_remembered_at_its_edge_and_passed_on_as_they_are():
    env = ActionHistory(Echo(), 2)
    env.reset()
    observation = env.step(np.array([-5, 8], np.float32))[0]
    assert observation.tolist() == [0, 0, -1, 3, 1, -5, 8]
    assert env.observation_space.contains(observation)
