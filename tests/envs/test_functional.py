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
        (SAFE, {"horizon": 0}, "horizon is a whole number from 1 on, not 0"),
    ],
)
def test_what_does_not_exist_is_one_clear_error(name, options, message):
    with pytest.raises(UsageError) as caught:
        functional.make(name, **options)
    assert message in str(caught.value)


def test_a_batch_of_rollouts_is_one_compiled_scan_over_different_tracks():
    simulation = functional.make(SAFE, horizon=5)

    @jax.jit
    def rollout(simulation, keys, actions):
        def stepped(episodes, action):
            episodes, *answer = jax.vmap(simulation.step, (0, None))(episodes, action)
            return episodes, answer

        episodes, _, signals = jax.vmap(simulation.reset)(keys)
        return episodes, signals, jax.lax.scan(stepped, episodes, actions)[1]

    actions = jnp.tile(jnp.array([0.5, 0.0], jnp.float32), (6, 1))
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
