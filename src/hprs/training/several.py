"""The rewards of a population whose members share an environment and a task."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array

from hprs.rewards.base import Reward
from hprs.semantics.evaluation import Signals
from hprs.training.configuration import Configuration
from hprs.wrappers.arguments import chosen_reward
from hprs.wrappers.single import TaskWrapper


@dataclass(frozen=True)
class Several:
    """Pays every row of a batch the reward of its member.

    Every reward is computed for every row, which costs less than to take the rows apart: it is a
    few operations on numbers that are there already.
    """

    rewards: tuple[Reward, ...]
    """Different ones."""
    which: tuple[int, ...]
    """Of every member its reward; a member's rows follow one another."""

    def init(self, signals: Signals) -> Any:
        """The memories of all rewards."""
        return tuple(reward.init(signals) for reward in self.rewards)

    def step(
        self, memory: Any, signals: Signals, terminated: Array, truncated: Array
    ) -> tuple[Any, Array]:
        """The memories, and the reward of each row."""
        made = [
            reward.step(kept, signals, terminated, truncated)
            for reward, kept in zip(self.rewards, memory, strict=True)
        ]
        rows = len(terminated) // len(self.which)
        which = np.repeat(np.asarray(self.which), rows)
        paid = jnp.stack([jnp.broadcast_to(one, which.shape) for _, one in made])
        return tuple(kept for kept, _ in made), paid[which, np.arange(len(which))]


def reward_of(configurations: Sequence[Configuration], environment: TaskWrapper) -> Reward:
    """The reward of a population's members, one of each.

    Args:
        configurations: Of the members; they share the environment and the task.
        environment: The wrapped environment of one of them.
    """
    rewards: dict[str, Reward] = {}
    for one in configurations:
        key = _key(one)
        if key not in rewards:
            rewards[key] = chosen_reward(
                one.reward,
                one.task,
                environment,
                end=one.end,
                discount=one.discount,
                options=one.reward_options,
            )
    different = list(rewards)
    if len(different) == 1:
        return rewards[different[0]]
    return Several(tuple(rewards.values()), tuple(different.index(_key(o)) for o in configurations))


def _key(configuration: Configuration) -> str:
    options = dict(configuration.reward_options)
    return json.dumps([configuration.reward, configuration.end, configuration.discount, options])
