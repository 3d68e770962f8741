"""Advantages worked by hand: what each kind of end means, and what a mixed-up one would give."""

import jax.numpy as jnp
import numpy as np
import pytest

from hprs.training.ppo.losses import advantages, normalised

GAMMA, DECAY = 0.5, 0.5


def column(*values):
    return jnp.asarray(values)[:, None]


def found(*, terminated=(0, 0), truncated=(0, 0), valid=(1, 1)):
    """Two steps: rewards 1 and 2, values 10 and 20, and 20 and 40 of the states reached."""
    result = advantages(
        column(1.0, 2.0),
        column(10.0, 20.0),
        column(20.0, 40.0),
        column(*terminated).astype(bool),
        column(*truncated).astype(bool),
        column(*valid).astype(bool),
        gamma=GAMMA,
        gae_lambda=DECAY,
    )
    return result[:, 0].tolist()


def test_where_nothing_ends_the_critic_stands_for_the_future():
    # 2 + 40 / 2 - 20 = 2, and 1 + 20 / 2 - 10 + 2 / 4 = 1.5.
    assert found() == [1.5, 2.0]


def test_a_terminated_episode_has_no_future():
    # 2 - 20 = -18, and 1 + 10 - 10 - 18 / 4 = -3.5.
    assert found(terminated=(0, 1)) == [-3.5, -18.0]


def test_a_truncated_episode_has_the_future_of_its_own_last_state():
    """And the next episode's advantage does not reach back across its end."""
    # 1 + 20 / 2 - 10 = 1, without 2 / 4 from the episode that follows.
    assert found(truncated=(1, 0)) == [1.0, 2.0]
    assert found(truncated=(0, 1)) == [1.5, 2.0]


def test_terminated_counts_where_an_episode_is_both():
    assert found(terminated=(0, 1), truncated=(0, 1)) == found(terminated=(0, 1))


def test_a_step_that_only_resets_counts_nowhere():
    # Its own estimate is 0, and nothing of it reaches the step before, which ended an episode.
    assert found(truncated=(1, 0), valid=(1, 0)) == [1.0, 0.0]
    assert found(valid=(0, 1)) == [0.0, 2.0]


@pytest.mark.parametrize("invalid", [np.nan, 1e9])
def test_normalised_advantages_leave_out_what_does_not_count(invalid):
    valid = jnp.asarray([True, True, True, False])
    result = normalised(jnp.asarray([1.0, 2.0, 3.0, invalid]), valid)
    np.testing.assert_allclose(result[:3], [-1.0, 0.0, 1.0], atol=1e-6)
