"""Environments on the host: every mode shows a learner the same transitions."""

from __future__ import annotations

import json
from collections import Counter

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from hprs.envs import task_of, task_text_of
from hprs.spec.parser import parse_task
from hprs.training.arrays import pack, unpack
from hprs.training.configuration import Configuration
from hprs.training.environment import make_environment
from hprs.training.host import SingleEnvironments, VectorEnvironments, make_host
from hprs.training.random_states import training_seed
from hprs.wrappers.single import wrap
from hprs.wrappers.vector import wrap_vector

CART_POLE, LANDER = "hprs/CartPole-v0", "hprs/LunarLanderObstacle-v0"
VECTOR_MODES = list(AutoresetMode)

TASK = parse_task("""
signal unused  = obs[0]   in [0, 1]
signal push    = action[0] in [-1, 1]
signal pair[2] = obs[0:2] in [0, 100]
signal count   = obs[1]   in [0, 100]

ensure    below:  count <= 3
encourage gentle: abs(push) <= 0.5
encourage small:  sum(pair) <= 60
""")
"""Ends an episode in its fourth step."""

TERMINATED, TRUNCATED, BOTH = (True, False), (False, True), (True, True)


class Scripted(gym.Env):
    """Counts episodes and steps; pays 10 e + s."""

    observation_space = gym.spaces.Box(0, 100, (2,), np.float32)
    action_space = gym.spaces.Box(-1, 1, (1,), np.float32)

    def __init__(self, *episodes):
        self.episodes = episodes
        self.seen = np.zeros(2, np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.seen[:] = self.seen[0] + 1, 0
        return self.seen.copy(), {}

    def step(self, action):
        self.seen[1] += 1
        length, ends = self.episodes[int(self.seen[0] - 1) % len(self.episodes)]
        terminated, truncated = ends if self.seen[1] == length else (False, False)
        return self.seen.copy(), float(10 * self.seen[0] + self.seen[1]), terminated, truncated, {}


SCRIPTS = (
    ((2, TERMINATED), (1, TRUNCATED), (99, BOTH)),
    ((3, BOTH), (2, TRUNCATED)),
)


def scripted(mode):
    """Two environments; mode None: single ones."""
    if mode is None:
        return SingleEnvironments([wrap(Scripted(*script), TASK, "env") for script in SCRIPTS])
    makers = [lambda script=script: Scripted(*script) for script in SCRIPTS]
    # Which writes every step's observations to the same array.
    bare = SyncVectorEnv(makers, copy=False, autoreset_mode=mode)
    return VectorEnvironments(wrap_vector(bare, TASK, "env"))


def pushes(step):
    return np.array([[0.125 * step], [-0.125 * step]], np.float32)


N, T, C, B = (False, False), TERMINATED, TRUNCATED, BOTH

AT_ONCE = [
    # episode and count that each row reached, its ends, and those that it goes on from
    ((1, 1), N, (1, 1), (1, 1), N, (1, 1)),
    ((1, 2), T, (2, 0), (1, 2), N, (1, 2)),
    ((2, 1), C, (3, 0), (1, 3), B, (2, 0)),
    ((3, 1), N, (3, 1), (2, 1), N, (2, 1)),
    ((3, 2), N, (3, 2), (2, 2), C, (3, 0)),
    ((3, 3), N, (3, 3), (3, 1), N, (3, 1)),
    ((3, 4), T, (4, 0), (3, 2), N, (3, 2)),
    ((4, 1), N, (4, 1), (3, 3), B, (4, 0)),
]
"""The fourth step of an episode is one that only the task ends."""

LATER = [
    ((1, 1), N, (1, 1), N),
    ((1, 2), T, (1, 2), N),
    ((2, 0), None, (1, 3), B),
    ((2, 1), C, (2, 0), None),
    ((3, 0), None, (2, 1), N),
    ((3, 1), N, (2, 2), C),
    ((3, 2), N, (3, 0), None),
    ((3, 3), N, (3, 1), N),
    ((3, 4), T, (3, 2), N),
    ((4, 0), None, (3, 3), B),
]
"""What each row reached, and its ends; None: it was only reset."""


def signals(states, actions):
    """push, pair, count of each row; at reset the push is zero."""
    return [
        [0.0 if count == 0 else float(action[0]), episode, count, count]
        for (episode, count), action in zip(states, actions, strict=True)
    ]


def check(made, reached, following, ends, valid, actions):
    np.testing.assert_array_equal(made.reached.observation, reached)
    np.testing.assert_array_equal(made.next.observation, following)
    np.testing.assert_array_equal(made.reached.signals, signals(reached, actions))
    np.testing.assert_array_equal(made.next.signals, signals(following, actions))
    np.testing.assert_array_equal(made.terminated, [end[0] for end in ends])
    np.testing.assert_array_equal(made.truncated, [end[1] for end in ends])
    np.testing.assert_array_equal(made.valid, valid)
    paid = [10 * e + s if is_valid else 0 for (e, s), is_valid in zip(reached, valid, strict=True)]
    np.testing.assert_array_equal(made.reward, paid)
    for array in (made.reward, *made.reached, *made.next):
        assert array.dtype == np.float32
    for array in (made.terminated, made.truncated, made.valid):
        assert array.dtype == bool
    same = made.reached.observation is made.next.observation
    assert same == (reached == following)
    assert (made.reached.signals is made.next.signals) == same


@pytest.mark.parametrize("mode", [None, AutoresetMode.SAME_STEP, AutoresetMode.DISABLED])
def test_an_episode_ends_with_its_final_state_and_the_next_begins_in_the_same_step(mode):
    host = scripted(mode)
    seen = host.reset(0)
    np.testing.assert_array_equal(seen.observation, [[1, 0], [1, 0]])
    np.testing.assert_array_equal(seen.signals, [[0, 1, 0, 0]] * 2)
    kept = []
    for step, row in enumerate(AT_ONCE):
        made = host.step(pushes(step))
        reached, ends, following = ([row[i], row[i + 3]] for i in range(3))
        kept.append((made, reached, following, ends, [True, True], pushes(step)))
        assert host.seen is made.next
    # Only now: no step writes to what an earlier one returned.
    for each in kept:
        check(*each)
    host.close()


def test_where_a_step_only_resets_it_is_no_transition():
    host = scripted(AutoresetMode.NEXT_STEP)
    host.reset(0)
    kept = []
    for step, (first, first_ends, second, second_ends) in enumerate(LATER):
        reached, valid = [first, second], [first_ends is not None, second_ends is not None]
        ends = [first_ends or N, second_ends or N]
        kept.append((host.step(pushes(step)), reached, reached, ends, valid, pushes(step)))
    for each in kept:
        check(*each)


def transitions(host, count):
    """How often which transition occurs among the first so many of each row."""
    before, found, left = host.reset(0), [], [count] * host.number
    actions = pushes(3)
    while any(left):
        made = host.step(actions)
        for row in np.flatnonzero(made.valid):
            if left[row]:
                left[row] -= 1
                parts = [*before, made.reward, made.terminated, made.truncated, *made.reached]
                found.append((row, *(tuple(np.ravel(part[row])) for part in parts)))
        before = made.next
    return Counter(found)


@pytest.mark.parametrize("mode", VECTOR_MODES)
def test_all_modes_show_the_same_transitions(mode):
    assert transitions(scripted(mode), 30) == transitions(scripted(None), 30)


def cart_poles(number):
    task = task_of(CART_POLE)
    return SingleEnvironments([make_environment(CART_POLE, task) for _ in range(number)])


def valid_rows(host, row, steps):
    """The valid transitions of one row, under actions that depend on its steps only."""
    host.reset(4)
    generator, rows = np.random.default_rng(row), []
    action = generator.integers(2)
    while len(rows) < steps:
        made = host.step(np.full(host.number, action))
        if made.valid[row]:
            rows.append([*made.reached.observation[row], *made.reached.signals[row]])
            rows[-1] += [made.reward[row], made.terminated[row], made.truncated[row]]
            action = generator.integers(2)
    return np.array(rows)


@pytest.mark.parametrize("mode", VECTOR_MODES)
def test_vectors_of_cart_poles_are_single_ones_bit_for_bit(mode):
    kwargs = {"autoreset_mode": mode}
    bare = gym.make_vec(CART_POLE, 3, vectorization_mode="sync", vector_kwargs=kwargs)
    host = VectorEnvironments(wrap_vector(bare, task_of(CART_POLE)))
    for row in range(3):
        expected = valid_rows(cart_poles(3), row, 200)
        assert expected[:, -2].sum() >= 3
        np.testing.assert_array_equal(valid_rows(host, row, 200), expected)


def configuration(environment=CART_POLE, **options):
    text = task_text_of(environment)
    return Configuration(environment, text, "ppo", {"gamma": 0.99}, 1_000, **options)


def test_the_native_vector_of_cart_poles_is_the_single_one():
    host = make_host(configuration(horizon=17), 1)
    assert isinstance(host, VectorEnvironments)
    task = task_of(CART_POLE)
    single = SingleEnvironments([make_environment(CART_POLE, task, horizon=17)])
    expected = valid_rows(single, 0, 200)
    assert expected[:, -1].any() and expected[:, -2].any()
    # Its sines are NumPy's.
    np.testing.assert_allclose(valid_rows(host, 0, 200), expected, atol=1e-5)


def test_what_has_no_native_vector_is_stepped_one_by_one():
    pytest.importorskip("Box2D")
    host = make_host(configuration(LANDER), 2)
    assert isinstance(host, SingleEnvironments)
    assert host.number == 2
    assert host.action_space == gym.spaces.Box(-1, 1, (2,), np.float32)
    assert host.reset(0).observation.shape == (2, *host.observation_space.shape)
    host.close()


def stored(state):
    """A state as it comes back from a checkpoint."""
    arrays = {name: value for name, value in state.items() if isinstance(value, np.ndarray)}
    rest = {name: value for name, value in state.items() if name not in arrays}
    return json.loads(json.dumps(rest)) | unpack(pack(arrays))


def go_on(host, actions):
    flat = []
    for action in actions:
        reward, terminated, truncated, valid, reached, following = host.step(action)
        flat += [reward, terminated, truncated, valid, *reached, *following]
    return [array.tobytes() for array in flat]


@pytest.mark.parametrize("environment", [CART_POLE, LANDER])
def test_running_episodes_come_back_bit_for_bit_in_other_environments(environment):
    if environment == LANDER:
        pytest.importorskip("Box2D")
    task = task_of(environment)

    def make():
        return SingleEnvironments([make_environment(environment, task) for _ in range(3)])

    host, other = make(), make()
    host.action_space.seed(1)
    actions = [[host.action_space.sample() for _ in range(3)] for _ in range(400)]
    actions = np.array(actions)
    host.reset(8)
    ends = sum(host.step(action).terminated.sum() for action in actions[:200])
    assert ends >= 3
    assert other.restore(stored(host.state())) == []
    for ours, theirs in zip(host.seen, other.seen, strict=True):
        assert ours.tobytes() == theirs.tobytes()
    assert go_on(host, actions[200:]) == go_on(other, actions[200:])
    assert stored(host.state())["steps"] == other.state()["steps"] == 400


def test_an_episode_that_does_not_come_back_begins_anew_and_says_why():
    host, other = cart_poles(2), cart_poles(2)
    host.reset(8)
    for _ in range(5):
        host.step(np.array([0, 1]))
    state = host.state()
    state["actions 1"] = 1 - state["actions 1"]
    assert other.restore(stored(state)) == ["the same actions led elsewhere"]
    fresh = make_environment(CART_POLE, task_of(CART_POLE))
    observation, _ = fresh.reset(seed=training_seed(8, 5, 1))
    np.testing.assert_array_equal(other.seen.observation[1], observation)
    np.testing.assert_array_equal(other.seen.observation[0], host.seen.observation[0])
    np.testing.assert_array_equal(other.seen.signals[0], host.seen.signals[0])


def test_a_vector_begins_new_episodes_and_says_so():
    host, other = (make_host(configuration(), 2) for _ in range(2))
    first = host.reset(8)
    for _ in range(5):
        host.step(np.array([0, 1]))
    reasons = other.restore(stored(host.state()))
    assert reasons == ["a vector environment's state cannot be brought back"] * 2
    assert not np.array_equal(other.seen.observation, first.observation)
    assert other.step(np.array([0, 1])).valid.all()


def test_environments_are_seeded_apart_and_alike_every_time():
    host = cart_poles(3)
    seen = host.reset(3).observation
    assert len(np.unique(seen, axis=0)) == 3
    host.step(np.zeros(3, int))
    np.testing.assert_array_equal(host.reset(3).observation, seen)
    assert not np.array_equal(host.reset(4).observation, seen)
