"""What PPO can be told, with the defaults of a user's own environment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, get_type_hints


@dataclass(frozen=True)
class Settings:
    """Hyper-parameters, named as Stable-Baselines3 names them where it has them."""

    environments: int = 16
    """Environments that are stepped side by side."""
    vectorized: bool = False
    """Whether a native vector environment is stepped in one call, where there is one: faster for
    many cheap environments, but a training that is resumed then begins new episodes."""
    n_steps: int = 256
    """Steps of each environment between two updates."""
    batch_size: int = 256
    """Transitions of a minibatch; it divides `environments * n_steps`."""
    n_epochs: int = 10
    """Passes over the transitions of a rollout."""
    net_arch: list[int] = field(default_factory=lambda: [64, 64])
    """Hidden layers of the policy's and of the critic's network."""
    critic_signals: bool = True
    """Whether the critic sees the task's signals too. The policy never does."""
    learning_rate: float | str = 3e-4
    """A number, or a schedule such as `linear_0.001`, which falls to 0 at the end."""
    gamma: float = 0.99
    """Discount."""
    gae_lambda: float = 0.95
    """Of generalised advantage estimation."""
    clip_range: float = 0.2
    """Largest change of an action's probability that pays, as a fraction."""
    ent_coef: float = 0.0
    """Weight of the entropy in the loss."""
    vf_coef: float = 0.5
    """Weight of the critic's error in the loss."""
    max_grad_norm: float = 0.5
    """A longer gradient is shortened to this."""
    log_std_init: float = 0.0
    """Logarithm of the initial deviation of actions, which are scaled to [-1, 1]."""
    normalize_advantage: bool = True
    """Whether each minibatch's advantages are shifted and scaled to mean 0 and deviation 1."""
    normalize_observations: bool = True
    """Whether observations are shifted and scaled by their running mean and deviation."""
    scale_reward: bool = True
    """Whether rewards are divided by the running deviation of the discounted return."""
    horizon_is_terminal: bool = False
    """Whether nothing is expected after the horizon."""

    @property
    def rollout(self) -> int:
        """Transitions between two updates."""
        return self.environments * self.n_steps

    @classmethod
    def of(cls, parameters: Mapping[str, Any]) -> Settings:
        """The settings of a configuration."""
        return cls(**parameters)


HYPERPARAMETERS: Mapping[str, tuple[Any, Any]] = MappingProxyType(
    {name: (kind, getattr(Settings(), name)) for name, kind in get_type_hints(Settings).items()}
)
"""Name to annotation and default."""
