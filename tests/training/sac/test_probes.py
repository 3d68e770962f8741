"""What is learned where the right answer is known: values, credit over time, and actions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hprs.training.configure import configure
from hprs.training.networks import apply
from hprs.training.sac.training import open_session
from tests.training.ppo.probes import TASK

GAMMA = 0.5
SETTINGS = {
    "batch_size": 32,
    "buffer_size": 2_000,
    "net_arch": [32],
    "learning_rate": 0.01,
    "learning_starts": 50,
    "gamma": GAMMA,
    "tau": 0.1,
    # No entropy: a value is then the return.
    "ent_coef": 0.0,
}


@pytest.fixture
def learn(tmp_path):
    task = tmp_path / "any.hprs"
    task.write_text(TASK)

    def learned(name, steps=500, **settings):
        session = open_session(
            [
                configure(
                    f"tests.training.ppo.probes:{name}BoxProbe-v0",
                    task_path=str(task),
                    reward="env",
                    algorithm="sac",
                    steps=10**6,
                    settings={**SETTINGS, **settings},
                )
            ]
        )
        while session.step < steps:
            session.advance(steps)
        return session

    return learned


def values(session, *observations):
    """The lower of both critics, of an action in the middle."""
    rows = jnp.asarray([[seen, 0.0] for seen in observations], jnp.float32)
    critics = session.learned(0).parameters.critics
    found = [apply(critic, rows, jax.nn.relu)[:, 0] for critic in critics]
    return np.asarray(jnp.minimum(*found))


@pytest.mark.parametrize("overlap", [True, False])
def test_a_terminated_episode_is_worth_its_reward(learn, overlap):
    np.testing.assert_allclose(values(learn("Terminal", overlap=overlap), 0), [1.0], atol=0.05)


def test_a_truncated_episode_is_worth_what_would_follow(learn):
    np.testing.assert_allclose(values(learn("Endless"), 0), [1 / (1 - GAMMA)], atol=0.1)


def test_nothing_follows_a_horizon_that_is_terminal(learn):
    """The mean over what is left of five steps, of which the observation tells nothing."""
    found = values(learn("Endless", horizon_is_terminal=True), 0)
    # V = 1 + 4/5 * gamma * V: one of five states has no future.
    np.testing.assert_allclose(found, [1 / (1 - 0.8 * GAMMA)], atol=0.1)
    assert 1 / (1 - 0.8 * GAMMA) < 0.85 / (1 - GAMMA)


def test_credit_goes_to_the_step_before(learn):
    np.testing.assert_allclose(values(learn("Credit"), 0, 1), [GAMMA, 1.0], atol=0.05)


def test_an_action_follows(learn):
    session = learn("Follow", steps=1_000)
    rows = jnp.asarray([[-1.0], [1.0]])
    found = np.asarray(session.shape.best(session.learned(0), rows))[:, 0]
    np.testing.assert_allclose(found, [-0.5, 0.5], atol=0.15)


def test_the_entropy_falls_to_its_target(learn):
    """The best action is one point; only the learned weight keeps the policy from it."""
    session = learn("Follow", steps=2_500, ent_coef="auto", target_entropy=-1.0)
    told = session.scalars(0)
    assert told["train/entropy"] == pytest.approx(-1.0, abs=0.4)
    assert 0.001 < told["train/ent_coef"] < 0.5
