"""Sessions: on the device as in Gymnasium, resumed as if never stopped, and the same for a seed."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hprs.training.configure import configure
from hprs.training.environment import make_configured
from hprs.training.evaluation import evaluate
from hprs.training.networks import apply
from hprs.training.ppo import on_device
from hprs.training.ppo.on_device import DeviceSession
from hprs.training.ppo.on_host import HostSession
from hprs.training.ppo.training import open_session
from hprs.training.statistics import unseen
from hprs.training.trees import one_of
from tests.training.ppo.point import ID, TASK

SMALL = {"environments": 4, "n_steps": 16, "batch_size": 32, "n_epochs": 2, "net_arch": [8]}
SEEDS = range(1_000_000, 1_000_006)


@pytest.fixture(scope="module")
def configured(tmp_path_factory):
    file = tmp_path_factory.mktemp("task") / "point.hprs"
    file.write_text(TASK)

    def of(kind, seed=0):
        task = {"task_path": str(file)} if kind == "device" else {}
        name = ID if kind == "device" else "hprs/CartPole-v0"
        return configure(name, steps=1_000, settings=SMALL, seed=seed, **task)

    return of


def learned(configuration, updates=2):
    session = open_session([configuration])
    for _ in range(updates):
        session.advance(session.step + 1)
    return session


@pytest.fixture(scope="module")
def point(configured):
    return learned(configured("device"))


def leaves(session):
    return [np.asarray(leaf) for leaf in jax.tree.leaves(session.learned(0))]


def same(one, other):
    return all(np.array_equal(a, b) for a, b in zip(leaves(one), leaves(other), strict=True))


def test_what_has_a_simulation_is_trained_on_the_device(point, configured):
    assert isinstance(point, DeviceSession)
    assert point.step == 2 * 64
    assert isinstance(open_session([configured("host")]), HostSession)


def test_episodes_on_the_device_are_those_of_gymnasium(configured):
    """Signals from info, observation and both actions; returns, lengths and assessments."""
    configuration = configured("device")
    session = open_session([configuration])
    # A push to the right, so that episodes end where the task says, each at its own time.
    states = session._states
    *hidden, last = states.member.parameters.policy
    pushing = [*hidden, last._replace(bias=last.bias + 1.0)]
    parameters = states.member.parameters._replace(policy=pushing)
    session._states = states._replace(member=states.member._replace(parameters=parameters))
    member = session.learned(0)

    def policy(observation):
        return np.asarray(session.shape.best(member, jnp.asarray(observation)))

    wanted = evaluate(lambda: make_configured(configuration), policy, SEEDS)
    [found] = session.evaluate(SEEDS, lambda done: None)
    for one, other in zip(found, wanted, strict=True):
        assert one.seed == other.seed
        assert one.assessment.length == other.assessment.length
        assert one.total == pytest.approx(other.total, abs=1e-4)
        assert one.assessment.pam == pytest.approx(other.assessment.pam, abs=1e-6)
        assert one.assessment.requirements == pytest.approx(other.assessment.requirements)
    assert len({one.assessment.length for one in found}) > 1


@pytest.mark.parametrize("kind", ["device", "host"])
def test_a_resumed_session_is_one_that_never_stopped(kind, configured):
    whole = learned(configured(kind))
    kept = whole.capture(0)
    again = open_session([configured(kind)])
    assert again.restore(0, kept) == []
    assert again.step == whole.step
    assert same(again, whole)
    for session in (whole, again):
        session.advance(session.step + 1)
    assert same(again, whole)
    one, other = (session.evaluate(SEEDS, lambda done: None) for session in (whole, again))
    assert one == other


@pytest.mark.parametrize("kind", ["device", "host"])
def test_a_seed_determines_the_training(kind, configured):
    one = learned(configured(kind))
    assert same(one, learned(configured(kind)))
    assert not same(one, learned(configured(kind, seed=1)))


def test_the_first_ratio_is_1_with_statistics_of_two_rollouts(point):
    shape, environment = point.shape, point._environment
    state = one_of(point._states, 0)
    assert float(state.member.observations.count) > 100
    _, rollout = on_device.roll_out(shape, environment, point._simulation, state)
    member = state.member
    outputs = apply(member.parameters.policy, shape.seen(member, rollout.observation))
    again = shape.actions.log_prob(outputs, member.parameters.log_std, rollout.action)
    np.testing.assert_allclose(jnp.exp(again - rollout.log_prob), 1.0, atol=1e-5)
    # With the statistics of the next rollout it would not be.
    later = member._replace(
        observations=member.observations.updated(rollout.observation + 1, rollout.valid)
    )
    outputs = apply(member.parameters.policy, shape.seen(later, rollout.observation))
    other = shape.actions.log_prob(outputs, member.parameters.log_std, rollout.action)
    assert float(jnp.abs(other - rollout.log_prob).max()) > 1e-4


def test_a_rollout_goes_on_where_episodes_do_not_end(point):
    """Reached and left are one state there; where one ends, another begins."""
    state = one_of(point._states, 0)
    _, rollout = on_device.roll_out(point.shape, point._environment, point._simulation, state)
    ended = np.asarray(rollout.terminated | rollout.truncated)[:-1]
    following = np.asarray(rollout.observation)[1:]
    goes_on = (np.asarray(rollout.reached)[:-1] == following).all(axis=-1)
    assert ended.any()
    assert np.array_equal(goes_on, ~ended)
    # A new episode starts at rest.
    assert (following[ended][:, 1] == 0).all()


def test_statistics_are_those_of_all_samples_that_count():
    rng = np.random.default_rng(0)
    parts = [rng.normal(3, 2, (5, 4, 2)).astype(np.float32) for _ in range(3)]
    masks = [rng.random((5, 4)) < 0.7 for _ in parts]
    found = unseen((2,))
    for part, mask in zip(parts, masks, strict=True):
        found = found.updated(jnp.asarray(part), jnp.asarray(mask))
    together = np.concatenate([part[mask] for part, mask in zip(parts, masks, strict=True)])
    np.testing.assert_allclose(found.mean, together.mean(axis=0), rtol=1e-4)
    np.testing.assert_allclose(found.variance, together.var(axis=0), rtol=1e-3)
    nothing = found.updated(jnp.full((1, 2), 1e9), jnp.zeros(1, bool))
    np.testing.assert_allclose(nothing.mean, found.mean)


def test_a_reward_of_nothing_stays_finite(configured):
    session = open_session([configured("device")])
    shape, state = session.shape, one_of(session._states, 0)
    state, rollout = on_device.roll_out(shape, session._environment, session._simulation, state)
    zero = rollout._replace(reward=jnp.zeros_like(rollout.reward))
    member, scalars = shape.update(state.member, zero, one_of(session._weights, 0), 0)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(member.parameters))
    assert float(scalars["reward_scale"]) > 0
