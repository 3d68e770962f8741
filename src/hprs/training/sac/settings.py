"""What SAC can be told, with the defaults of a user's own environment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, get_type_hints

from hprs.training.schedules import number_after


@dataclass(frozen=True)
class Settings:
    """Hyper-parameters, named as Stable-Baselines3 names them where it has them."""

    environments: int = 1
    """Environments that are stepped side by side."""
    train_freq: int = 1
    """Steps of each environment between two rounds of updates."""
    gradient_steps: int = 1
    """Updates of a round: with 1 environment and `train_freq` 1, one an environment step."""
    buffer_size: int = 300_000
    """Transitions that are remembered."""
    learning_starts: int = 100
    """Environment steps with random actions before the first update."""
    batch_size: int = 256
    """Transitions of an update."""
    net_arch: list[int] | dict[str, list[int]] = field(default_factory=lambda: [256, 256])
    """Hidden layers of all networks, or an object: `{"pi": [64, 64], "qf": [256, 256]}`."""
    learning_rate: float | str = 3e-4
    """A number, or a schedule such as `linear_0.001`, which falls to 0 at the end."""
    gamma: float = 0.99
    """Discount."""
    tau: float = 0.005
    """Share of the critics that their targets take over in an update."""
    ent_coef: float | str = "auto_0.02"
    """Weight of the entropy: a number, `auto` to learn it from 1 on, or its first value as in
    `auto_0.02`: a step of HPRS is worth 0.01 to 0.1."""
    target_entropy: float | str = "auto"
    """What a learned weight aims at; `auto`: minus the number of components of an action."""
    horizon_is_terminal: bool = False
    """Whether nothing is expected after the horizon."""
    overlap: bool = True
    """Whether environments that Python steps do so while the networks are updated: an update then
    misses the newest transition."""

    @property
    def layers(self) -> tuple[list[int], list[int]]:
        """Hidden layers of the policy and of the critics."""
        if isinstance(self.net_arch, Mapping):
            return self.net_arch["pi"], self.net_arch["qf"]
        return self.net_arch, self.net_arch

    @property
    def learns_entropy(self) -> bool:
        """Whether the weight of the entropy is learned."""
        return isinstance(self.ent_coef, str)

    @property
    def first_entropy(self) -> float:
        """The weight of the entropy at the start."""
        if not isinstance(self.ent_coef, str):
            return self.ent_coef
        start = number_after("auto_", self.ent_coef)
        return 1.0 if start is None else start

    @property
    def round(self) -> int:
        """Environment steps between two rounds of updates."""
        return self.environments * self.train_freq

    @classmethod
    def of(cls, parameters: Mapping[str, Any]) -> Settings:
        """The settings of a configuration."""
        return cls(**parameters)


HYPERPARAMETERS: Mapping[str, tuple[Any, Any]] = MappingProxyType(
    {name: (kind, getattr(Settings(), name)) for name, kind in get_type_hints(Settings).items()}
)
"""Name to annotation and default."""
