"""Losses, gradients and steps are those of Stable-Baselines3's own `SAC.train`, in float64.

It is given our noise instead of drawing some, and batches instead of a replay buffer's.
"""

import gymnasium as gym
import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
import torch
from gymnasium import spaces
from stable_baselines3 import SAC
from stable_baselines3.common import policies
from stable_baselines3.common.distributions import DiagGaussianDistribution
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.type_aliases import ReplayBufferSamples

from hprs.training.actions import squashed_actions_of
from hprs.training.networks import Layer
from hprs.training.sac import learner
from hprs.training.sac.learner import Batch, Member, Optimisers, Parameters, Shape, Weights
from hprs.training.sac.settings import Settings

SIZE, ROWS, OUTPUTS = 3, 64, 2
ACTIONS = spaces.Box(-1, 1, (OUTPUTS,), np.float64)
RATE, GAMMA, TAU, FIRST = 3e-3, 0.97, 0.02, 0.1


class Nothing(gym.Env):
    observation_space = spaces.Box(-np.inf, np.inf, (SIZE,), np.float64)
    action_space = ACTIONS

    def reset(self, *, seed=None, options=None):
        return np.zeros(SIZE), {}

    def step(self, action):
        return np.zeros(SIZE), 0.0, False, False, {}


class Silent(Logger):
    """Keeps what is recorded."""

    def __init__(self):
        super().__init__(None, [])


def theirs(ent_coef, **policy):
    """A model of Stable-Baselines3 in float64."""
    torch.manual_seed(0)
    model = SAC(
        "MlpPolicy",
        Nothing(),
        learning_rate=RATE,
        gamma=GAMMA,
        tau=TAU,
        ent_coef=ent_coef,
        device="cpu",
        policy_kwargs={"net_arch": {"pi": [16, 8], "qf": [16, 12]}, **policy},
    )
    model.set_logger(Silent())
    model.policy.double()
    if model.log_ent_coef is not None:
        model.log_ent_coef = model.log_ent_coef.detach().double().requires_grad_(True)
        kind = policy.get("optimizer_class", torch.optim.Adam)
        model.ent_coef_optimizer = kind([model.log_ent_coef], lr=RATE)
    # Targets that are not the critics.
    with torch.no_grad():
        for weights in model.critic_target.parameters():
            weights.add_(0.05 * torch.randn_like(weights))
    return model


def layer(*modules):
    weights = np.concatenate([m.weight.detach().numpy().T for m in modules], 1)
    bias = np.concatenate([m.bias.detach().numpy() for m in modules])
    return Layer(jnp.asarray(weights), jnp.asarray(bias))


def network(body):
    return [layer(module) for module in body if isinstance(module, torch.nn.Linear)]


def parameters_of(model):
    """Their weights in the form of ours."""
    actor, log = model.actor, model.log_ent_coef
    hidden = [layer(module) for module in actor.latent_pi if isinstance(module, torch.nn.Linear)]
    log_entropy = np.log(FIRST) if log is None else log.detach().numpy()[0]
    return Parameters(
        policy=[*hidden, layer(actor.mu, actor.log_std)],
        critics=(network(model.critic.qf0), network(model.critic.qf1)),
        log_entropy=jnp.asarray(log_entropy),
    )


def targets_of(model):
    return network(model.critic_target.qf0), network(model.critic_target.qf1)


def batches(number):
    rng = np.random.default_rng(1)
    for _ in range(number):
        terminated = rng.random(ROWS) < 0.2
        yield (
            Batch(
                observation=rng.normal(size=(ROWS, SIZE)),
                action=rng.uniform(-1, 1, (ROWS, OUTPUTS)),
                reward=rng.normal(size=ROWS),
                terminated=terminated,
                truncated=~terminated & (rng.random(ROWS) < 0.2),
                valid=np.ones(ROWS, bool),
                reached=rng.normal(size=(ROWS, SIZE)),
            ),
            rng.normal(size=(2, ROWS, OUTPUTS)),
        )


class Fed:
    """Feeds batches and noise to their `train`."""

    def __init__(self, model, monkeypatch):
        self.model, self.noises = model, iter(())
        # It would make observations float32.
        monkeypatch.setattr(policies, "preprocess_obs", lambda seen, *_, **__: seen)
        monkeypatch.setattr(
            DiagGaussianDistribution, "sample", lambda distribution: self.sample(distribution)
        )
        monkeypatch.setattr(model.replay_buffer, "sample", lambda *_, **__: self.batch)

    def sample(self, distribution):
        normal = distribution.distribution
        return normal.mean + normal.stddev * next(self.noises)

    def train(self, batch, noise):
        self.noises = iter(torch.as_tensor(noise))
        column = [torch.as_tensor(x).double() for x in batch]
        seen, action, reward, terminated, _, _, reached = column
        self.batch = ReplayBufferSamples(
            seen, action, reached, terminated[:, None], reward[:, None], None
        )
        self.model.train(1, ROWS)
        return self.model.logger.name_to_value


def shape():
    return Shape(Settings(), SIZE, squashed_actions_of(ACTIONS))


def begin(model):
    made = parameters_of(model)
    return Member(
        parameters=made,
        targets=targets_of(model),
        optimiser=Optimisers(*map(learner.OPTIMISER.init, made)),
        key=jnp.zeros(2, jnp.uint32),
    )


def weights(ent_coef):
    learned = float(isinstance(ent_coef, str))
    return Weights(RATE, 0.0, GAMMA, TAU, -float(OUTPUTS), learned, 0.0)


def close(found, wanted, tolerance):
    """All leaves, each relative to its largest number."""
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
        scale = max(1e-12, float(np.abs(other).max()))
        np.testing.assert_allclose(np.asarray(one) / scale, other / scale, atol=tolerance)


ENTROPY = pytest.mark.parametrize("ent_coef", [f"auto_{FIRST}", FIRST], ids=["learned", "fixed"])


@ENTROPY
def test_losses_and_gradients(ent_coef, monkeypatch):
    """With plain gradient descent the change of a parameter is its gradient."""
    monkeypatch.setattr(learner, "OPTIMISER", optax.identity())
    with jax.enable_x64(True):
        model = theirs(ent_coef, optimizer_class=torch.optim.SGD)
        before, member = parameters_of(model), begin(model)
        [(batch, noise)] = batches(1)
        member, report = shape().update(member, batch, noise, weights(ent_coef), 0.0)
        told = Fed(model, monkeypatch).train(batch, noise)
        after = parameters_of(model)
        gradient = jax.tree.map(lambda a, b: (a - b) / RATE, before, after)
        found = jax.tree.map(lambda a, b: (a - b) / RATE, before, member.parameters)
        assert all(np.abs(leaf).max() > 1e-4 for leaf in jax.tree.leaves(gradient.policy))
        close(found, gradient, 1e-5)
        close(member.targets, targets_of(model), 1e-9)
        assert report.critic_loss == pytest.approx(told["train/critic_loss"], rel=1e-5)
        assert report.policy_loss == pytest.approx(told["train/actor_loss"], rel=1e-5)
        assert report.ent_coef == pytest.approx(told["train/ent_coef"], rel=1e-5)
        if isinstance(ent_coef, str):
            assert report.entropy_loss == pytest.approx(told["train/ent_coef_loss"], rel=1e-5)


@ENTROPY
def test_ten_updates(ent_coef, monkeypatch):
    with jax.enable_x64(True):
        model = theirs(ent_coef)
        member, fed = begin(model), Fed(model, monkeypatch)
        update = jax.jit(shape().update)
        for batch, noise in batches(10):
            member, _ = update(member, batch, noise, weights(ent_coef), 0.0)
            fed.train(batch, noise)
        close(member.parameters, parameters_of(model), 1e-6)
        close(member.targets, targets_of(model), 1e-6)


def test_a_terminated_state_has_no_future_and_a_truncated_one_has():
    """Of three equal transitions that end differently; the switch ends both."""
    one = shape()
    member = one.make(0, {})
    ended = jnp.array([False, True, False])
    cut = jnp.array([False, False, True])
    same = jnp.ones((3, SIZE))
    batch = Batch(same, jnp.zeros((3, OUTPUTS)), jnp.ones(3), ended, cut, ~(ended & cut), same)
    noise = jnp.zeros((3, OUTPUTS))
    open_, closed = (Weights(RATE, 0.0, GAMMA, TAU, -2.0, 1.0, flag) for flag in (0.0, 1.0))
    running, over, cut_off = one.target(member, batch, noise, open_)
    assert over == 1.0 and running == cut_off != 1.0
    running, over, cut_off = one.target(member, batch, noise, closed)
    assert over == cut_off == 1.0 != running


def test_what_only_resets_counts_nowhere():
    one = shape()
    member = one.make(0, {})
    [(batch, noise)] = batches(1)
    batch = jax.tree.map(jnp.asarray, batch)
    half = jnp.arange(ROWS) < ROWS // 2
    spoilt = batch._replace(
        valid=half, reward=jnp.where(half, batch.reward, 1e9), reached=batch.reached
    )
    other = batch._replace(valid=half)
    found, wanted = (
        one.update(member, rows, jnp.asarray(noise), weights("auto"), 0.0)[0]
        for rows in (spoilt, other)
    )
    close(found.parameters, jax.device_get(wanted.parameters), 1e-6)
