import gymnasium as gym
import numpy as np
import pytest

from hprs.envs import task_of
from hprs.training.environment import make_environment
from hprs.training.episode_log import EpisodeLog, EpisodeState
from hprs.wrappers.single import wrap

from ..probes import Slider, slider_task

IDS = ["hprs/CartPole-v0", "hprs/LunarLanderObstacle-v0", "hprs/BipedalWalker-v0", "hprs/BipedalWalkerHardcore-v0"]  # fmt: skip


def make(name):
    if name == "slider":
        return EpisodeLog(wrap(Slider(), slider_task()))
    if name != IDS[0]:
        pytest.importorskip("Box2D")
    return EpisodeLog(make_environment(name, task_of(name)))


def play(env, steps):
    """Some episodes, and the beginning of one of so many steps."""
    env.action_space.seed(3)
    env.reset(seed=5)
    for _ in range(4):
        ended = False
        while not ended:
            _, _, terminated, truncated, _ = env.step(env.action_space.sample())
            ended = terminated or truncated
        env.reset()
    for _ in range(steps):
        env.step(env.action_space.sample())


def go_on(env, actions):
    seen = [env.step(action) for action in actions]
    return [(s[0].tolist(), s[1], s[2], s[3]) for s in seen], seen[-1][4]["potential"]


@pytest.mark.parametrize(
    ("name", "steps"), [*((name, steps) for name in IDS for steps in (0, 7)), ("slider", 2)]
)
def test_a_running_episode_comes_back_bit_for_bit_in_another_environment(name, steps):
    env, other = make(name), make(name)
    play(env, steps)
    state = env.state()
    assert not state.lost
    assert len(state.actions) == steps
    assert other.replay(EpisodeState(actions=state.actions, **state.to_json())) == ""
    env.action_space.seed(8)
    actions = [env.action_space.sample() for _ in range(4)]
    assert go_on(env, actions) == go_on(other, actions)
    assert env.reset()[0].tolist() == other.reset()[0].tolist()


def test_the_first_episode_comes_back_from_its_seed():
    env, other = make("slider"), make("slider")
    env.reset(seed=9)
    env.step(np.array([0.3]))
    assert other.replay(env.state()) == ""
    assert np.array_equal(env.observation, other.observation)


def test_an_environment_that_goes_elsewhere_is_found_out():
    env = make("slider")
    play(env, 3)
    state = env.state()
    changed = EpisodeState(state.start, state.actions + 1e-9)
    assert env.replay(changed) == "the same actions led elsewhere"
    ended = EpisodeState(state.start, np.ones((40, 1)))
    assert env.replay(ended) == "the same actions led elsewhere"
    start = {**state.start, "generator": {"bit_generator": "MT19937"}}
    assert env.replay(EpisodeState(start, state.actions)) == "the same actions led elsewhere"


class Ageing(gym.Env):
    """Pays once, in its third step, for how many episodes it has seen; nothing else shows it."""

    observation_space = gym.spaces.Box(0, 1, (1,))
    action_space = gym.spaces.Discrete(2)

    def __init__(self):
        self.age = 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.age, self.steps = self.age + 1, 0
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.steps += 1
        return np.zeros(1, np.float32), float(self.age * (self.steps == 3)), False, False, {}


@pytest.mark.parametrize("steps", [2, 3, 7])
def test_hidden_state_is_found_out_as_soon_as_a_reward_has_shown_it(steps):
    env, other = EpisodeLog(Ageing()), EpisodeLog(Ageing())
    for seed in (1, 2):
        env.reset(seed=seed)
    for _ in range(steps):
        env.step(0)
    assert other.replay(env.state()) == ("the same actions led elsewhere" if steps >= 3 else "")


def test_another_kind_of_generator_comes_back_as_well():
    env, other = EpisodeLog(Slider()), EpisodeLog(Slider())
    for one in (env, other):
        one.unwrapped.np_random = np.random.Generator(np.random.MT19937(3))
    env.reset()
    env.step(np.array([0.1]))
    assert other.replay(env.state()) == ""
    assert env.reset()[0].tolist() == other.reset()[0].tolist()


def test_gymnasiums_walker_alone_does_not_come_back_and_is_found_out():
    pytest.importorskip("Box2D")
    found = set()
    for seed in range(3):
        env, other = (EpisodeLog(gym.make("BipedalWalker-v3")) for _ in range(2))
        env.action_space.seed(seed)
        play(env, 60)
        reason = other.replay(env.state())
        same = np.array_equal(env.observation, other.observation)
        assert same == (reason == "")
        found.add(reason)
    assert "the same actions led elsewhere" in found
