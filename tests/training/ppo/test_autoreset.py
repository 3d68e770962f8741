"""In each of Gymnasium's three autoreset modes a learner counts, and learns from, the same steps.

Under NEXT_STEP every second step of the shortest probe only resets it: reward 0, and the final
observation before it. One of them in advantages, losses or statistics moves the numbers below.
"""

import gymnasium as gym
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from hprs import wrap_vector
from hprs.training.configure import configure
from hprs.training.environment import make_configured
from hprs.training.host.vector import VectorEnvironments
from hprs.training.networks import apply
from hprs.training.ppo.on_host import HostSession
from tests.training.ppo.probes import TASK
from tests.training.ppo.test_probes import GAMMA, SETTINGS

NUMBER, STEPS = SETTINGS["environments"], SETTINGS["n_steps"]


@pytest.fixture(params=list(AutoresetMode), ids=lambda mode: mode.name.lower())
def mode(request):
    return request.param


@pytest.fixture
def learn(tmp_path, mode):
    file = tmp_path / "any.hprs"
    file.write_text(TASK)

    def learned(name, updates, **settings):
        configuration = configure(
            f"tests.training.ppo.probes:{name}Probe-v0",
            task_path=str(file),
            reward="env",
            steps=10**6,
            settings={**SETTINGS, **settings},
        )
        one = make_configured(configuration)
        makers = [lambda: gym.make(f"{name}Probe-v0", disable_env_checker=True)] * NUMBER
        bare = SyncVectorEnv(makers, autoreset_mode=mode)
        several = VectorEnvironments(wrap_vector(bare, configuration.task, one.reward))
        session = HostSession(configuration, one, several)
        for _ in range(updates):
            session.advance(session.step + 1)
        return session

    return learned


def values(session, *observations):
    rows = jnp.asarray(observations, jnp.float32)[:, None]
    return np.asarray(apply(session.learned(0).parameters.critic, rows))[:, 0]


def test_a_terminated_episode_is_worth_its_reward(learn):
    np.testing.assert_allclose(values(learn("Terminal", 24), 0), [1.0], atol=0.05)


def test_a_truncated_episode_is_worth_what_would_follow(learn):
    np.testing.assert_allclose(values(learn("Endless", 16), 0), [1 / (1 - GAMMA)], atol=0.1)


def test_credit_goes_to_the_step_before(learn):
    np.testing.assert_allclose(values(learn("Credit", 20), 0, 1), [GAMMA, 1.0], atol=0.05)


def test_steps_that_only_reset_are_not_counted(learn, mode):
    session = learn("Terminal", 1)
    resets = NUMBER * STEPS // 2 if mode == AutoresetMode.NEXT_STEP else 0
    assert session.step == NUMBER * STEPS - resets


def test_statistics_are_of_transitions_alone(learn):
    session = learn("Terminal", 1, normalize_observations=True, scale_reward=True)
    member = session.learned(0)
    # Acted upon is the first state alone, which is 0; the last one is 1.
    assert float(member.observations.mean[0]) == 0.0
    assert float(member.returns.mean) == pytest.approx(1.0, abs=1e-3)
    for counted in (member.observations.count, member.returns.count):
        assert float(counted) == pytest.approx(session.step, abs=1)
