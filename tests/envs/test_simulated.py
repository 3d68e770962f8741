"""A user's simulation as a Gymnasium environment."""

from dataclasses import dataclass

import gymnasium as gym
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env

from hprs.envs.simulated import SimulatedEnv, draw_key
from hprs.errors import UsageError

SEEN = spaces.Box(-50.0, 50.0, (2,), np.float32)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Walk:
    """Goes `gain` times the action, and ends beyond 1."""

    gain: jax.Array

    def reset(self, key):
        x = jax.random.uniform(key)
        return x, jnp.stack([x, -x]), {"x": x, "both": jnp.stack([x, -x])}

    def step(self, state, action):
        x = state + self.gain * action.sum()
        seen = jnp.stack([x, -x])
        return x, seen, {"x": x, "both": seen}, 2 * x, x > 1, x < -1


def walk(action_space=None, gain=0.5):
    box = spaces.Box(-1.0, 1.0, (1,), np.float32)
    return SimulatedEnv(Walk(jnp.asarray(gain)), SEEN, action_space or box)


@pytest.mark.parametrize("actions", [None, spaces.Discrete(3)], ids=["box", "discrete"])
def test_it_is_an_environment_as_gymnasium_checks_it(actions):
    env = walk(actions)
    check_env(env, skip_render_check=True)


def test_a_step_is_that_of_the_functions():
    env = walk()
    seen, info = env.reset(seed=3)
    x = info["signals"]["x"]
    assert type(x) is float and seen[0] == np.float32(x)
    np.testing.assert_array_equal(info["signals"]["both"], seen)
    seen, reward, terminated, truncated, info = env.step(np.array([-0.5]))
    assert info["signals"]["x"] == pytest.approx(x - 0.25)
    assert reward == pytest.approx(2 * (x - 0.25))
    assert (terminated, truncated) == (False, False)
    x -= 0.25
    while x <= 1:
        x += 0.5
        assert env.step(np.array([1.0]))[2] == (x > 1)


def test_truncation_is_not_termination():
    env = walk(gain=10.0)
    env.reset(seed=0)
    assert env.step(np.array([-1.0]))[2:4] == (False, True)


def test_the_episode_of_a_seed_is_that_of_its_key():
    key = draw_key(gym.utils.seeding.np_random(7)[0])
    _, seen, _ = walk().simulation.reset(jax.random.wrap_key_data(jnp.asarray(key)))
    np.testing.assert_array_equal(walk().reset(seed=7)[0], seen)
    env = walk()
    first, second = env.reset(seed=7)[0], env.reset()[0]
    assert first[0] != second[0]


def test_other_parameters_share_a_compilation():
    from hprs.envs.simulated import _reset

    walk().reset(seed=0)
    before = _reset._cache_size()
    walk(gain=0.125).reset(seed=0)
    assert _reset._cache_size() == before


def test_an_observation_can_be_written_to():
    seen, _ = walk().reset(seed=0)
    seen[0] = 0.0


def test_a_class_that_jax_does_not_know_is_refused():
    class Plain:
        def reset(self, key): ...

        def step(self, state, action): ...

    with pytest.raises(UsageError, match=r"Plain.*register_dataclass"):
        SimulatedEnv(Plain(), SEEN, spaces.Discrete(2))


def test_a_step_before_the_reset_is_refused():
    with pytest.raises(UsageError, match="before reset"):
        walk().step(np.zeros(1))
