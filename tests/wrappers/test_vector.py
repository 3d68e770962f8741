"""The vector wrapper gives what the single wrapper gives, in every autoreset mode."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv

import hprs
from hprs.errors import SignalError, UsageError
from hprs.wrappers.single import wrap
from hprs.wrappers.vector import wrap_vector
from tests.probes import Slider, slider_task

COUNT, STEPS = 5, 60
MODES = list(AutoresetMode)


def actions(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (STEPS, COUNT, 1))


def episodes(kind: str, end: str) -> list[list[tuple]]:
    """For each environment, its steps (reward, terminated, truncated, potential, assessment)."""
    found = []
    for index in range(COUNT):
        env = wrap(Slider(), slider_task(kind), end=end, discount=0.9)
        env.reset(seed=index)
        steps, reset = [], False
        for action in actions()[:, index]:
            if reset:
                _, info = env.reset()
                steps.append((0.0, False, False, info["potential"], None, info["margins"]))
                reset = False
                continue
            _, reward, terminated, truncated, info = env.step(action)
            entry = (reward, terminated, truncated, info["potential"], info.get("assessment"))
            steps.append((*entry, info["margins"]))
            reset = terminated or truncated
        found.append(steps)
    return found


@pytest.mark.parametrize("kind", ["achieve", "conquer"])
@pytest.mark.parametrize("end", ["paper", "invariant", "released"])
def test_next_step_mode_equals_single_environments_step_for_step(kind, end):
    compare(SyncVectorEnv([Slider] * COUNT), kind, end)


def test_next_step_mode_of_asynchronous_environments_equals_single_ones_step_for_step():
    """A step too many of a row that the task has ended draws nothing from its generator."""
    compare(AsyncVectorEnv([Slider] * 3, context="spawn"), "achieve", "paper")


def compare(bare, kind: str, end: str) -> None:
    """Hold a vector environment in mode NEXT_STEP against single ones."""
    envs = wrap_vector(bare, slider_task(kind), end=end, discount=0.9)
    expected = episodes(kind, end)
    count, ends = envs.num_envs, 0
    envs.reset(seed=0)
    for number, action in enumerate(actions()):
        _, rewards, terminated, truncated, infos = envs.step(action[:count])
        for index in range(count):
            reward, own_end, cut, potential, assessment, margins = expected[index][number]
            assert rewards[index] == pytest.approx(reward, abs=1e-12)
            assert (terminated[index], truncated[index]) == (own_end, cut)
            assert infos["potential"][index] == pytest.approx(potential)
            for label, margin in margins.items():
                assert infos["margins"][label][index] == pytest.approx(margin)
            if assessment is not None:
                ends += 1
                assert infos["assessment"][index] == assessment
    assert ends > count
    envs.close()


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.DISABLED])
def test_other_modes_give_the_same_transitions_without_the_reset_steps(mode):
    def run(envs, by_hand):
        envs.reset(seed=3)
        found = []
        for action in actions(1):
            _, rewards, terminated, truncated, infos = envs.step(action)
            done = terminated | truncated
            final = infos.get("final_info", {})
            for index in np.flatnonzero(done):
                source = final if mode == AutoresetMode.SAME_STEP and not by_hand else infos
                found.append((index, source["assessment"][index], source["potential"][index]))
            found.append(rewards.round(12).tolist())
            if by_hand and done.any():
                envs.reset(options={"reset_mask": done})
        return found

    task = slider_task()
    disabled = SyncVectorEnv([Slider] * COUNT, autoreset_mode=AutoresetMode.DISABLED)
    reference = run(wrap_vector(disabled, task), True)
    tested = SyncVectorEnv([Slider] * COUNT, autoreset_mode=mode)
    assert run(wrap_vector(tested, task), mode == AutoresetMode.DISABLED) == reference


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_wrapping_outside_equals_wrapping_inside_synchronous_environments(mode):
    task = slider_task()
    outside = wrap_vector(SyncVectorEnv([Slider] * COUNT, autoreset_mode=mode), task)
    inside = SyncVectorEnv([lambda: wrap(Slider(), task)] * COUNT, autoreset_mode=mode)
    outside.reset(seed=7)
    inside.reset(seed=7)
    for action in actions(2):
        mine, theirs = outside.step(action), inside.step(action)
        for ours, reference in zip(mine[:4], theirs[:4], strict=True):
            np.testing.assert_allclose(ours, reference, atol=1e-12)
        assert set(theirs[4]) <= set(mine[4])
        for key in ("potential", "cost"):
            np.testing.assert_allclose(mine[4][key], theirs[4][key], atol=1e-12)
        if "final_info" in theirs[4] and theirs[4]["_final_info"].any():
            mask = theirs[4]["_final_info"]
            np.testing.assert_array_equal(mine[4]["_final_info"], mask)
            ours, reference = mine[4]["final_info"], theirs[4]["final_info"]
            assert list(ours["assessment"][mask]) == list(reference["assessment"][mask])
            for index in np.flatnonzero(mask):
                np.testing.assert_array_equal(
                    mine[4]["final_obs"][index], theirs[4]["final_obs"][index]
                )


def test_asynchronous_environments_give_the_same_rewards():
    task = slider_task()
    asynchronous = wrap_vector(
        AsyncVectorEnv([Slider] * 2, context="spawn", autoreset_mode=AutoresetMode.SAME_STEP), task
    )
    synchronous = wrap_vector(
        SyncVectorEnv([Slider] * 2, autoreset_mode=AutoresetMode.SAME_STEP), task
    )
    asynchronous.reset(seed=5)
    synchronous.reset(seed=5)
    try:
        for action in actions(3)[:, :2]:
            for ours, reference in zip(
                asynchronous.step(action)[:4], synchronous.step(action)[:4], strict=True
            ):
                np.testing.assert_allclose(ours, reference)
    finally:
        asynchronous.close()


def cart_pole_task():
    from hprs.spec.task import Requirement, Signal, Source, Task

    x = Signal("x", -4.8, 4.8, source=Source("obs", (), 0))
    return Task(
        (x,),
        (Requirement("ensure", "near", abs(x) <= 0.06), Requirement("conquer", "left", x <= 0)),
    )


def test_asynchronous_next_step_resets_what_the_task_ends():
    make = lambda: gym.make("CartPole-v1")  # noqa: E731
    task = cart_pole_task()
    envs = wrap_vector(AsyncVectorEnv([make] * 2, context="spawn"), task)
    reference = wrap_vector(SyncVectorEnv([make] * 2), task)
    envs.reset(seed=1)
    reference.reset(seed=1)
    try:
        ended = 0
        for _ in range(60):
            ours, theirs = envs.step(np.array([1, 0])), reference.step(np.array([1, 0]))
            for mine, other in zip(ours[:4], theirs[:4], strict=True):
                np.testing.assert_allclose(mine, other)
            ended += ours[2].sum()
        assert ended > 4
    finally:
        envs.close()


def test_native_vector_environments_are_reset_where_the_task_ends_an_episode():
    native = gym.make_vec("CartPole-v1", 3)
    envs = wrap_vector(native, cart_pole_task())
    envs.reset(seed=0)
    after_end = []
    ended = np.zeros(3, bool)
    for _ in range(60):
        observation, rewards, terminated, _, _ = envs.step(np.ones(3, int))
        after_end += [(abs(observation[i, 0]) <= 0.05, rewards[i]) for i in np.flatnonzero(ended)]
        ended = terminated
    assert len(after_end) > 4
    assert all(near and reward == 0.0 for near, reward in after_end)


class Unknown(gym.vector.VectorEnv):
    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012
    num_envs = 2
    single_observation_space = observation_space = gym.spaces.Box(-1.0, 1.0, (1,))
    single_action_space = action_space = gym.spaces.Discrete(2)


def test_a_vector_environment_without_single_resets_is_refused_by_name():
    with pytest.raises(UsageError, match="Unknown cannot reset single sub-environments"):
        wrap_vector(Unknown(), cart_pole_task())
    assert wrap_vector(Unknown(), cart_pole_task(), end_on_violation=False)


def test_a_missing_info_entry_names_signal_and_sub_environment():
    class Forgetful(Slider):
        def step(self, action):
            *rest, info = super().step(action)
            return *rest, {"lap": info["lap"]} if self.steps > 2 else info

    envs = wrap_vector(SyncVectorEnv([Slider, Forgetful]), slider_task())
    envs.reset(seed=0)
    with pytest.raises(SignalError, match="'force' is missing in sub-environment 1"):
        for _ in range(5):
            envs.step(np.zeros((2, 1)))


def test_nan_names_signal_step_and_sub_environment():
    class Broken(Slider):
        def step(self, action):
            observation, *rest = super().step(action)
            return (observation * (np.nan if self.steps == 3 else 1.0), *rest)

    envs = wrap_vector(SyncVectorEnv([Slider, Broken]), slider_task())
    envs.reset(seed=0)
    with pytest.raises(SignalError, match="signal 'x' is NaN at step 3 of sub-environment 1"):
        for _ in range(5):
            envs.step(np.zeros((2, 1)))


class Sparing(Slider):
    """Single precision, and an info entry of two numbers that is absent at reset."""

    def reset(self, **arguments):
        observation, info = super().reset(**arguments)
        return observation.astype(np.float32), info

    def step(self, action):
        observation, reward, terminated, truncated, info = super().step(action)
        info["load"] = np.array([0.25, 0.5])
        return observation.astype(np.float32).round(1), reward, terminated, truncated, info


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("count", [1, 2, 3])
def test_initial_values_of_vectors_and_single_precision_equal_the_single_wrapper(mode, count):
    task = hprs.parse_task(
        "signal x = obs[0] in [-9, 9]\nsignal load[2] = info.load initially 0.5 in [0, 1]\n"
        "ensure near: x <= 0.3\nencourage light: sum(load) <= 0.9"
    )
    envs = wrap_vector(SyncVectorEnv([Sparing] * count, autoreset_mode=mode), task)
    singles = [wrap(Sparing(), task) for _ in range(count)]
    _, infos = envs.reset(seed=0)
    for index, env in enumerate(singles):
        _, info = env.reset(seed=index)
        assert info["margins"]["light"] == infos["margins"]["light"][index] == pytest.approx(-0.1)
    for push in (0.2, -0.1, 0.15, 0.1):
        _, rewards, terminated, _, _ = envs.step(np.full((count, 1), push))
        for index, env in enumerate(singles):
            _, reward, ended, _, _ = env.step(np.array([push]))
            assert (rewards[index], terminated[index]) == (pytest.approx(reward, abs=1e-12), ended)
        if terminated.any():
            break
    if mode == AutoresetMode.NEXT_STEP:
        for _ in range(20):
            envs.step(np.full((count, 1), 0.3))


class FromInfo(gym.vector.VectorEnv):
    """A native vector environment that draws from its own generator, and reports in `info`."""

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012
    num_envs = 2
    single_observation_space = observation_space = gym.spaces.Box(-1.0, 1.0, (1,))
    single_action_space = action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros((2, 1)), {"lap": self.np_random.uniform(size=2)}


def lap_task():
    return hprs.parse_task("signal lap = info.lap in [0, 1]\nconquer far: lap >= 0.5")


def test_asynchronous_environments_without_shared_memory_are_refused_where_they_reset_twice():
    def make(**arguments):
        return AsyncVectorEnv([Slider], context="spawn", shared_memory=False, **arguments)

    for envs, task in (
        (make(), slider_task("achieve")),
        (make(autoreset_mode=AutoresetMode.SAME_STEP), slider_task("achieve")),
    ):
        try:
            if envs.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP:
                wrap_vector(envs, task)
            else:
                with pytest.raises(UsageError, match=r"shared_memory=False.* resets .* twice"):
                    wrap_vector(envs, task)
        finally:
            envs.close()


@pytest.mark.parametrize("context", [None, "spawn"])
def test_wrapping_moves_no_random_draw_of_sub_environments(context):
    def make():
        envs = (
            SyncVectorEnv([Slider] * 2)
            if context is None
            else AsyncVectorEnv([Slider] * 2, context=context)
        )
        envs.reset(seed=11)
        return envs

    bare, wrapped = make(), make()
    outside = wrap_vector(wrapped, slider_task())
    try:
        for _ in range(2):
            np.testing.assert_array_equal(outside.reset()[0], bare.reset()[0])
    finally:
        bare.close()
        outside.close()


def test_wrapping_moves_no_random_draw_of_a_native_vector_environment():
    bare, inner = FromInfo(), FromInfo()
    bare.reset(seed=3)
    inner.reset(seed=3)
    drawn = bare.reset()[1]["lap"]
    envs = wrap_vector(inner, lap_task())
    np.testing.assert_array_equal(envs.reset()[1]["lap"], drawn)
    # One that has never drawn has no generator yet, and gets none.
    unseeded = FromInfo()
    wrap_vector(unseeded, lap_task())
    assert unseeded._np_random is None


class Wrong(FromInfo):
    """Supplies what a task cannot read."""

    def __init__(self, lap):
        self.lap = lap

    def reset(self, *, seed=None, options=None):
        return np.zeros((2, 1)), {} if self.lap is None else {"lap": self.lap}


@pytest.mark.parametrize(
    ("lap", "message"),
    [
        (None, "signal 'lap' is missing at reset: info has no 'lap'"),
        (
            np.zeros((2, 3)),
            r"'lap' must have shape \(2,\), one row a sub-environment, got shape \(2, 3\)",
        ),
        (0.5, r"'lap' must have shape \(2,\), one row a sub-environment, got shape \(\)"),
        (np.array(["a", "b"]), r"'lap' must be an array of numbers of shape \(2,\), got array"),
        (np.array([0.5, np.nan]), "signal 'lap' is NaN at step 0 of sub-environment 1"),
    ],
)
def test_what_info_must_not_hold_is_refused_when_wrapping(lap, message):
    with pytest.raises(SignalError, match=message):
        wrap_vector(Wrong(lap), lap_task())


def test_a_function_over_batches_is_checked_when_wrapping():
    lap = hprs.parse_task("signal lap in [0, 1]\nconquer far: lap >= 0.5")
    for returned, message in (
        (None, "must return a dictionary"),
        ({"lapp": np.zeros(2)}, "'lapp', which is no signal of the task. Did you mean 'lap'"),
        ({"lap": np.zeros(3)}, "must have shape"),
    ):
        with pytest.raises(SignalError, match=message):
            wrap_vector(FromInfo(), lap, signals=lambda *_, value=returned: value)
    envs = wrap_vector(FromInfo(), lap, signals=lambda *_: {"lap": [0.25, 2.0]})
    assert envs.reset()[1]["margins"]["far"].tolist() == [-0.25, 1.5]


@pytest.mark.parametrize("mode", MODES)
def test_signals_of_reached_and_of_newest_states_are_those_of_single_environments(mode):
    envs = wrap_vector(SyncVectorEnv([Slider] * COUNT, autoreset_mode=mode), slider_task())
    singles = [wrap(Slider(), slider_task()) for _ in range(COUNT)]
    names = [signal.name for signal in slider_task().signals]

    def same(values, row):
        return [values[name][row] for name in names] == [
            singles[row].signal_values[name] for name in names
        ]

    envs.reset(seed=list(range(COUNT)))
    for row, single in enumerate(singles):
        single.reset(seed=row)
        assert same(envs.signal_values, row)
    due: set[int] = set()
    for action in actions(4):
        _, _, terminated, truncated, _ = envs.step(action)
        done = terminated | truncated
        for row in set(range(COUNT)) - due:
            singles[row].step(action[row])
            assert same(envs.reached_signal_values, row)
            assert mode == AutoresetMode.SAME_STEP or same(envs.signal_values, row)
        if mode == AutoresetMode.DISABLED and done.any():
            # One after the other: each reset leaves the other rows as they are.
            for row in np.flatnonzero(done):
                envs.reset(options={"reset_mask": np.arange(COUNT) == row})
        ended = set(np.flatnonzero(done).tolist())
        for row in due if mode == AutoresetMode.NEXT_STEP else ended:
            singles[row].reset()
        due = ended if mode == AutoresetMode.NEXT_STEP else set()
        assert all(same(envs.signal_values, row) for row in range(COUNT))
