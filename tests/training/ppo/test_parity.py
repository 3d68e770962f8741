"""Advantages, losses and gradients are those of Stable-Baselines3's PPO, in float64.

On purpose different: a Box's actions are scaled to [-1, 1] outside of what is compared; a truncated
episode's future is a next value here and is added to the reward there, which is the same number;
the critic's values are never clipped.
"""

import gymnasium as gym
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import torch
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.vec_env import DummyVecEnv

from hprs.training.actions import actions_of
from hprs.training.networks import Layer
from hprs.training.ppo.learner import OPTIMISER, Parameters, Shape
from hprs.training.ppo.losses import Batch, Weights, advantages, normalised
from hprs.training.ppo.settings import Settings

SIZE, ROWS = 3, 64
SPACES = {"box": spaces.Box(-1, 1, (2,), np.float64), "discrete": spaces.Discrete(4)}
RATE, CLIP, ENTROPY, VALUE, LENGTH = 3e-3, 0.2, 0.01, 0.5, 0.5


class Nothing(gym.Env):
    observation_space = spaces.Box(-np.inf, np.inf, (SIZE,), np.float64)

    def __init__(self, space):
        self.action_space = space

    def reset(self, *, seed=None, options=None):
        return np.zeros(SIZE), {}

    def step(self, action):
        return np.zeros(SIZE), 0.0, False, False, {}


def theirs(space):
    """A policy of Stable-Baselines3 in float64, with weights that are not its first ones."""
    torch.manual_seed(0)
    made = DummyVecEnv([lambda: Nothing(space)])
    policy = PPO("MlpPolicy", made, device="cpu", learning_rate=RATE).policy.double()
    with torch.no_grad():
        for weights in policy.parameters():
            weights.add_(0.1 * torch.randn_like(weights))
    return policy


def layers(*modules):
    return [
        Layer(jnp.asarray(m.weight.detach().numpy().T), jnp.asarray(m.bias.detach().numpy()))
        for m in modules
    ]


def ours(policy):
    """The same weights as our parameters."""
    body = policy.mlp_extractor
    log_std = getattr(policy, "log_std", None)
    return Parameters(
        policy=layers(body.policy_net[0], body.policy_net[2], policy.action_net),
        critic=layers(body.value_net[0], body.value_net[2], policy.value_net),
        log_std=jnp.zeros(4) if log_std is None else jnp.asarray(log_std.detach().numpy()),
    )


def gradients(policy):
    """Theirs, in the form of our parameters."""

    def of(*modules):
        return [Layer(m.weight.grad.numpy().T, m.bias.grad.numpy()) for m in modules]

    body = policy.mlp_extractor
    log_std = getattr(policy, "log_std", None)
    return Parameters(
        policy=of(body.policy_net[0], body.policy_net[2], policy.action_net),
        critic=of(body.value_net[0], body.value_net[2], policy.value_net),
        log_std=np.zeros(4) if log_std is None else log_std.grad.numpy(),
    )


def batch(kind):
    """Transitions in NumPy, with ratios on both sides of the clip range."""
    rng = np.random.default_rng(1)
    action = rng.integers(0, 4, ROWS) if kind == "discrete" else rng.normal(size=(ROWS, 2))
    seen = rng.normal(size=(ROWS, SIZE))
    return Batch(
        observation=seen,
        critic=seen,
        action=action,
        log_prob=rng.normal(-2.0, 0.5, ROWS),
        advantage=rng.normal(0.3, 2.0, ROWS),
        target=rng.normal(size=ROWS),
        valid=np.ones(ROWS, bool),
    )


def their_loss(policy, rows):
    """The loss of `PPO.train`, statement by statement, from its own networks and distribution.

    `evaluate_actions` would first make observations float32.
    """
    of_policy, of_values = policy.mlp_extractor(torch.as_tensor(rows.observation))
    distribution = policy._get_action_dist_from_latent(of_policy)
    log_prob = distribution.log_prob(torch.as_tensor(rows.action))
    values, entropy = policy.value_net(of_values), distribution.entropy()
    advantage = torch.as_tensor(rows.advantage)
    advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
    ratio = torch.exp(log_prob - torch.as_tensor(rows.log_prob))
    clipped = torch.clamp(ratio, 1 - CLIP, 1 + CLIP)
    policy_loss = -torch.min(advantage * ratio, advantage * clipped).mean()
    value_loss = torch.nn.functional.mse_loss(torch.as_tensor(rows.target), values.flatten())
    return policy_loss - ENTROPY * entropy.mean() + VALUE * value_loss


def shape_of(kind):
    return Shape(Settings(critic_signals=False), SIZE, 0, actions_of(SPACES[kind]))


def weights():
    return Weights(RATE, 0.0, 0.99, 0.95, CLIP, ENTROPY, VALUE, LENGTH)


def close(found, wanted, tolerance=1e-5):
    """All leaves, each relative to its largest number."""
    pairs = zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True)
    for one, other in pairs:
        scale = max(1e-12, float(np.abs(other).max()))
        np.testing.assert_allclose(np.asarray(one) / scale, other / scale, atol=tolerance)


@pytest.mark.parametrize("kind", SPACES)
def test_losses_and_gradients(kind):
    rows, policy = batch(kind), theirs(SPACES[kind])
    their_loss(policy, rows).backward()
    with jax.enable_x64(True):
        shape, own = shape_of(kind), ours(policy)
        scaled = rows._replace(advantage=normalised(jnp.asarray(rows.advantage), rows.valid))
        (total, report), found = jax.value_and_grad(shape.loss, has_aux=True)(
            own, jax.tree.map(jnp.asarray, scaled), weights()
        )
        assert total.dtype == jnp.float64
        assert 0.2 < report.clip_fraction < 0.98
        close(total, their_loss(policy, rows).item(), 1e-9)
        close(found, gradients(policy), 1e-9)


@pytest.mark.parametrize("kind", SPACES)
def test_steps_of_the_optimiser(kind):
    """Three, with gradients shortened to a length and Adam's memory."""
    rows, policy = batch(kind), theirs(SPACES[kind])
    with jax.enable_x64(True):
        shape, own = shape_of(kind), ours(policy)
        memory, given = OPTIMISER.init(own), jax.tree.map(jnp.asarray, rows)
        for _ in range(3):
            policy.optimizer.zero_grad()
            their_loss(policy, rows).backward()
            length = torch.nn.utils.clip_grad_norm_(policy.parameters(), LENGTH)
            assert length > LENGTH
            policy.optimizer.step()
            own, memory, _ = shape.step(own, memory, given, weights(), RATE)
            close(own, ours(policy), 1e-6)


def episode(rng, times, number):
    """Rewards, values and ends of a rollout; some ends are both."""
    reward, value, following = rng.normal(size=(3, times, number))
    terminated = rng.random((times, number)) < 0.1
    truncated = rng.random((times, number)) < 0.1
    # Where nothing ends, the state reached is the next one left.
    ended = terminated | truncated
    following[:-1] = np.where(ended[:-1], following[:-1], value[1:])
    return reward, value, following, terminated, truncated


def test_advantages_and_targets():
    times, number, gamma, decay = 40, 6, 0.97, 0.9
    reward, value, following, terminated, truncated = episode(
        np.random.default_rng(2), times, number
    )
    ended = terminated | truncated
    buffer = RolloutBuffer(
        times, Nothing.observation_space, SPACES["box"], "cpu", decay, gamma, number
    )
    # As `collect_rollouts` does: the future of an episode that was cut off is added to its reward.
    cut = truncated & ~terminated
    for time in range(times):
        starts = ended[time - 1] if time else np.zeros(number)
        buffer.add(
            np.zeros((number, SIZE)),
            np.zeros((number, 2)),
            reward[time] + gamma * np.where(cut[time], following[time], 0),
            starts,
            torch.as_tensor(value[time]),
            torch.zeros(number),
        )
    buffer.compute_returns_and_advantage(torch.as_tensor(following[-1]), ended[-1])
    found = advantages(
        *map(jnp.asarray, (reward, value, following, terminated, truncated)),
        jnp.ones((times, number), bool),
        gamma=gamma,
        gae_lambda=decay,
    )
    np.testing.assert_allclose(found, buffer.advantages, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(found + value, buffer.returns, rtol=1e-4, atol=1e-5)
