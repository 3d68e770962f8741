"""New episodes begin in some rows of a batch: what a reward remembers is merged row by row."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import hprs
from hprs.errors import UsageError
from hprs.wrappers.merging import merge_rows
from hprs.wrappers.single import wrap
from hprs.wrappers.vector import wrap_vector
from tests.probes import Slider

TASK = hprs.parse_task(
    "signal x = obs[0] in [-9, 9]\nsignal both[2] = obs[0:2] in [-20, 20]\n"
    "ensure near: x <= 2\nencourage low: norm(both) <= 3"
)


class Pair(NamedTuple):
    before: object
    more: dict


class Progress:
    """Pays the change of a signal; its memory has many forms."""

    def __init__(self, name, form=lambda value: value, bare=lambda memory: memory):
        self.name, self.form, self.bare = name, form, bare

    def init(self, signals):
        return self.form(signals[self.name])

    def step(self, memory, signals, terminated, truncated):
        now = signals[self.name]
        change = now - self.bare(memory)
        return self.form(now), change if self.name == "x" else change[..., 0] - change[..., 1]


class Counting:
    """Pays the number of the step, counted from one Python number."""

    def init(self, signals):
        return 0

    def step(self, memory, signals, terminated, truncated):
        return memory + 1, memory + 1 + 0.0 * signals["x"]


def equal_to_single(reward, count, mode=AutoresetMode.NEXT_STEP, **options):
    """Hold the rewards of rows that end at different times against single environments."""
    makes = [lambda horizon=horizon: Slider(horizon) for horizon in range(4, 4 + count)]
    envs = wrap_vector(SyncVectorEnv(makes, autoreset_mode=mode, **options), TASK, reward)
    singles = [wrap(make(), TASK, reward) for make in makes]
    envs.reset(seed=0)
    for index, env in enumerate(singles):
        env.reset(seed=index)
    done = np.zeros(count, bool)
    rng = np.random.default_rng(1)
    for _ in range(25):
        actions = rng.uniform(-1, 1, (count, 1))
        _, rewards, *_ = envs.step(actions)
        for index, env in enumerate(singles):
            if done[index]:
                env.reset()
                done[index] = False
                continue
            _, expected, terminated, truncated, _ = env.step(actions[index])
            assert rewards[index] == pytest.approx(expected, abs=1e-12)
            done[index] = terminated or truncated
            if done[index] and mode == AutoresetMode.SAME_STEP:
                env.reset()
                done[index] = False


# With two rows and two components, axes that are taken for each other raise nothing.
@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("name", ["x", "both"])
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_a_reward_that_remembers_a_signal_pays_what_it_pays_a_single_environment(count, name, mode):
    equal_to_single(Progress(name), count, mode)


@pytest.mark.parametrize(
    ("form", "bare"),
    [
        (lambda v: (v, None, 1.5), lambda m: m[0]),
        (lambda v: {"now": v, "n": 1}, lambda m: m["now"]),
        (lambda v: Pair(v, {"twice": v * 2}), lambda m: m.more["twice"] - m.before),
    ],
)
def test_memories_may_be_tuples_dictionaries_and_named_tuples(form, bare):
    equal_to_single(Progress("both", form, bare), 3)


def test_a_memory_of_one_python_number_is_counted_row_by_row():
    equal_to_single(Counting(), 3)


@pytest.mark.parametrize("name", ["x", "both"])
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_remembered_signals_are_copies_where_an_environment_reuses_its_buffers(name, mode):
    assert Slider().observation_space.dtype == np.float64
    equal_to_single(Progress(name), 3, mode, copy=False)


def test_a_remembered_original_reward_is_a_copy():
    class Original(Progress):
        def init(self, signals):
            return 0.0 * signals["x"]

        def step(self, memory, signals, terminated, truncated):
            return signals["env_reward"], signals["env_reward"] - memory

    envs = SyncVectorEnv([Slider] * 2)
    plain, rewards = envs.step, np.zeros(2)

    def step(actions):
        observation, rewards[:], *rest = plain(actions)
        return observation, rewards, *rest

    envs.step = step
    wrapped = wrap_vector(envs, TASK, Original("x"))
    wrapped.reset(seed=0)
    first, second = (wrapped.step(np.full((2, 1), 0.1)) for _ in range(2))
    paid = [infos["env_reward"] for infos in (first[4], second[4])]
    np.testing.assert_array_equal(second[1], paid[1] - paid[0])
    assert second[1].all()


def test_the_batch_is_the_first_axis():
    mask = np.array([True, False])
    new, old = np.ones((2, 2, 3)), np.zeros((2, 2, 3))
    merged = merge_rows(mask, new, old)
    assert merged[0].all() and not merged[1].any()
    np.testing.assert_array_equal(merge_rows(mask, 0, np.array([4, 5])), [0, 5])


@dataclass
class Opaque:
    value: object


@pytest.mark.parametrize(
    ("form", "found"),
    [
        (Opaque, r"it holds Opaque\("),
        (np.transpose, r"it holds an array of shape \(2, 3\)"),
    ],
)
def test_a_memory_that_cannot_be_merged_is_refused_at_the_first_reset(form, found):
    envs = wrap_vector(SyncVectorEnv([Slider] * 3), TASK, Progress("both", form))
    with pytest.raises(UsageError, match=r"the batch \(3 rows\) as first axis.*" + found):
        envs.reset(seed=0)


@pytest.mark.parametrize("shape", [(2,), (2, 3)])
def test_last_actions_of_any_shape_are_kept_row_by_row(shape):
    class Shaped(Slider):
        def __init__(self, horizon):
            super().__init__(horizon)
            self.action_space = spaces.Box(-1.0, 1.0, shape, np.float64)

        def step(self, action):
            return super().step(action.ravel()[:1])

    last = np.ravel_multi_index([length - 1 for length in shape], shape)
    task = hprs.parse_task(
        "signal x = obs[0] in [-9, 9]\nsignal last in [-1, 1]\nencourage same: x + last <= 9"
    )

    def read(observation, action, last_action, info):
        batch = np.asarray(last_action).reshape(*np.shape(observation)[:-1], -1)
        return {"last": batch[..., last]}

    makes = [lambda: Shaped(3), lambda: Shaped(5)]
    envs = wrap_vector(SyncVectorEnv(makes), task, signals=read)
    envs.reset(seed=0)
    rng = np.random.default_rng(0)
    before, reset = np.zeros((2, *shape)), np.zeros(2, bool)
    for _ in range(12):
        actions = rng.uniform(-1, 1, (2, *shape))
        observation, _, terminated, truncated, infos = envs.step(actions)
        wanted = 9 - observation[:, 0] - np.where(reset, 0.0, before.reshape(2, -1)[:, last])
        np.testing.assert_allclose(infos["margins"]["same"], wanted)
        before = np.where(reset.reshape(2, *[1] * len(shape)), 0.0, actions)
        reset = terminated | truncated
