"""What is learned where the right answer is known: values, credit over time, and actions."""

import jax.numpy as jnp
import numpy as np
import pytest

from hprs.training.configure import configure
from hprs.training.networks import apply
from hprs.training.ppo.training import open_session
from tests.training.ppo.probes import TASK

GAMMA = 0.5
SETTINGS = {
    "environments": 4,
    "n_steps": 32,
    "batch_size": 64,
    "n_epochs": 10,
    "net_arch": [16],
    "learning_rate": 0.01,
    "gamma": GAMMA,
    "gae_lambda": 0.9,
    "critic_signals": False,
    "scale_reward": False,
    "normalize_observations": False,
}


@pytest.fixture
def learn(tmp_path):
    task = tmp_path / "any.hprs"
    task.write_text(TASK)

    def learned(name, updates=12, **settings):
        session = open_session(
            [
                configure(
                    f"tests.training.ppo.probes:{name}Probe-v0",
                    task_path=str(task),
                    reward="env",
                    steps=10**6,
                    settings={**SETTINGS, **settings},
                )
            ]
        )
        for _ in range(updates):
            session.advance(session.step + 1)
        return session

    return learned


def values(session, *observations):
    rows = jnp.asarray(observations, jnp.float32)[:, None]
    return np.asarray(apply(session.learned(0).parameters.critic, rows))[:, 0]


def actions(session, *observations):
    rows = jnp.asarray(observations, jnp.float32)[:, None]
    return np.asarray(session.shape.best(session.learned(0), rows))


def test_a_terminated_episode_is_worth_its_reward(learn):
    np.testing.assert_allclose(values(learn("Terminal"), 0), [1.0], atol=0.05)


def test_a_truncated_episode_is_worth_what_would_follow(learn):
    np.testing.assert_allclose(values(learn("Endless"), 0), [1 / (1 - GAMMA)], atol=0.1)


def test_nothing_follows_a_horizon_that_is_terminal(learn):
    """The mean over what is left of five steps, of which the observation tells nothing."""
    left = [sum(GAMMA**i for i in range(steps)) for steps in (5, 4, 3, 2, 1)]
    found = values(learn("Endless", horizon_is_terminal=True), 0)
    np.testing.assert_allclose(found, [np.mean(left)], atol=0.1)
    assert np.mean(left) < 0.85 / (1 - GAMMA)


def test_credit_goes_to_the_step_before(learn):
    np.testing.assert_allclose(values(learn("Credit"), 0, 1), [GAMMA, 1.0], atol=0.05)


def test_the_action_that_pays_is_chosen(learn):
    assert actions(learn("Sign"), -1, 1).tolist() == [0, 1]


def test_an_action_of_numbers_follows(learn):
    session = learn("Follow", updates=40)
    np.testing.assert_allclose(actions(session, -1, 1)[:, 0], [-0.5, 0.5], atol=0.15)
