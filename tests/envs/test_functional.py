"""The driving benchmarks as JAX functions."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hprs.envs import BENCHMARKS, functional
from hprs.errors import UsageError

from .driven import FOLLOW, SAFE


def test_the_functions_have_the_horizon_of_the_benchmark():
    assert set(functional.FUNCTIONAL) == {SAFE, FOLLOW}
    for name, defaults in functional.FUNCTIONAL.items():
        assert defaults.horizon == BENCHMARKS[name].horizon


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("hprs/SafeDrivin-v0", {}, "does not exist as JAX functions. Did you mean"),
        ("CartPole-v1", {}, "There are hprs/SafeDriving-v0, hprs/FollowLeader-v0"),
        (SAFE, {"trakcs": "gm"}, "There is no option 'trakcs'. Did you mean 'tracks'?"),
        (SAFE, {"horizon": 0}, "horizon needs a whole number from 1 to 1,000,000, got 0"),
    ],
)
def test_what_does_not_exist_is_one_clear_error(name, options, message):
    with pytest.raises(UsageError) as caught:
        functional.make(name, **options)
    assert message in str(caught.value)


@jax.jit
def rollout(simulation, keys, actions):
    def stepped(episodes, action):
        episodes, *answer = jax.vmap(simulation.step)(episodes, action)
        return episodes, answer

    episodes, _, signals = jax.vmap(simulation.reset)(keys)
    return episodes, signals, jax.lax.scan(stepped, episodes, actions)[1]


def test_a_batch_of_rollouts_is_one_compiled_scan_over_different_tracks():
    simulation = functional.make(SAFE, horizon=5)
    actions = jnp.tile(jnp.array([0.5, 0.0], jnp.float32), (6, 8, 1))
    keys = jax.random.split(jax.random.key(0), 8)
    episodes, start, (seen, signals, rewards, terminated, truncated) = rollout(
        simulation, keys, actions
    )
    assert set(episodes.track.tolist()) == {0, 1}
    assert seen.shape == (6, 8, simulation.observation_size)
    assert set(signals) == set(start) == set(simulation.signal_names)
    progress = np.concatenate([start["progress"][None], signals["progress"]])
    np.testing.assert_allclose(rewards, 100 * np.diff(progress, axis=0), atol=1e-4)
    assert (np.diff(progress, axis=0) >= 0).all()
    # Truncated from the horizon on, unless the episode has terminated.
    assert np.array_equal(truncated, (np.arange(6) >= 4)[:, None] & ~np.asarray(terminated))


@pytest.mark.parametrize("part", [0, 1])
def test_an_action_that_is_nan_shows_in_all_that_follows_and_in_no_other_episode(part):
    simulation = functional.make(SAFE, horizon=5)
    actions = np.tile(np.array([0.5, 0.0], np.float32), (6, 8, 1))
    actions[2, 3, part] = np.nan
    _, _, (seen, signals, rewards, terminated, truncated) = rollout(
        simulation, jax.random.split(jax.random.key(0), 8), actions
    )
    # A car whose commands are delayed drives on as before for up to a few steps.
    assert np.isnan(seen[2:, 3]).any(axis=1).all()
    assert np.isnan(signals[("speed_command", "steering")[part]][2, 3])
    for late in (rewards, signals["progress"], signals["clearance"], signals["speed"]):
        assert np.isnan(late[5:, 3]).all()
    # A flag cannot be NaN: what is not known to be free of contact ends the episode.
    assert np.isnan(seen[5, 3, 6:]).all()
    assert terminated[5, 3]
    assert not truncated[5, 3]
    others = np.arange(8) != 3
    for answer in (seen, rewards, *signals.values()):
        assert np.isfinite(answer[:2]).all()
        assert np.isfinite(answer[:, others]).all()
