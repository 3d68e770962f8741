"""Everything that determines a training, as frozen data."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from typing import Any

from hprs.errors import RunError
from hprs.rewards.shaping import DEFAULT_END, End
from hprs.spec.json_format import task_to_json
from hprs.spec.parser import parse_task
from hprs.spec.task import Task

OFTEN, SELDOM = 50, 10
"""After so many evaluations the interval of PPO in JAX becomes so many times as long."""


@dataclass(frozen=True)
class Configuration:
    """One training with one seed."""

    environment: str
    """Gymnasium id, `module:id` for an environment that a module registers."""
    task_text: str
    """The task, as its file says it."""
    algorithm: str
    """One of `ALGORITHMS`."""
    parameters: Mapping[str, Any]
    """All hyper-parameters of the algorithm."""
    steps: int
    """Environment steps of the whole training."""
    reward: str = "hprs"
    """A key of `REWARDS`."""
    end: End = DEFAULT_END
    """End-of-episode convention of the shaping."""
    horizon: int | None = None
    """Steps after which an episode is truncated; None: the environment's own horizon."""
    evaluation_interval: int = 10_000
    """Environment steps between two evaluations; later more, see `interval_after`."""
    evaluation_episodes: int = 10
    """Episodes of an evaluation."""
    seed: int = 0
    """Seed of the training."""
    environment_options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """Keyword arguments of `gymnasium.make`, as JSON values."""
    reward_options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """The reward's own options, as JSON values."""
    trainer: str = "sb3"
    """A key of `TRAINERS`; runs that do not say are older than all others."""

    @cached_property
    def task(self) -> Task:
        """The task."""
        return parse_task(self.task_text, path=f"task of {self.environment}")

    @property
    def home(self) -> dict[str, Any]:
        """Where a policy of it was trained, as JSON, so that its bundle alone can be assessed."""
        return {
            "environment": self.environment,
            "environment_options": dict(self.environment_options),
            "horizon": self.horizon,
        }

    @property
    def discount(self) -> float | None:
        """The learner's discount, which invariant shaping must share."""
        return self.parameters.get("gamma")

    @property
    def horizon_is_terminal(self) -> bool:
        """Whether the learner takes the horizon for the end of the task."""
        # Runs of earlier versions do not say.
        return self.parameters.get("horizon_is_terminal", False)

    def interval_after(self, evaluations: int) -> int:
        """Environment steps between an evaluation and the next.

        Args:
            evaluations: How many there were, this one included.
        """
        # Most is learned early, and an evaluation costs as much as many steps of a fast trainer.
        fast = (self.trainer, self.algorithm) == ("jax", "ppo")
        seldom = fast and evaluations >= OFTEN
        return self.evaluation_interval * (SELDOM if seldom else 1)

    @property
    def digest(self) -> str:
        """Eight hexadecimal digits that differ where numbers can; the seed is left out."""
        content = self.to_json()
        del content["seed"]
        # What changes nothing is left out, as in runs of versions that did not know it.
        if not content["reward_options"]:
            del content["reward_options"]
        if not self.horizon_is_terminal:
            content["parameters"].pop("horizon_is_terminal", None)
        if content["trainer"] == "sb3":
            del content["trainer"]
        # The task's meaning, not its text: a comment changes no number.
        content["task_text"] = task_to_json(self.task)
        text = json.dumps(content, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()[:8]

    def to_json(self) -> dict[str, Any]:
        """The configuration as a JSON object."""
        return {**asdict(self), "parameters": dict(self.parameters)}

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Configuration:
        """The inverse of `to_json`.

        Raises:
            RunError: Fields are missing or unknown.
        """
        known = {field.name for field in fields(cls)}
        if set(content) != known:
            different = ", ".join(sorted(set(content) ^ known))
            raise RunError(f"it was written by another version of hprs: {different}.")
        return cls(**content)
