"""The rewards of a population whose members share an environment and a task."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array

from hprs.rewards.base import Reward
from hprs.semantics.evaluation import Signals


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


def reward_of(rewards: Sequence[Reward]) -> Reward:
    """The reward of members, of each of which there is one."""
    different: list[Reward] = []
    for reward in rewards:
        if reward not in different:
            different.append(reward)
    if len(different) == 1:
        return different[0]
    return Several(tuple(different), tuple(different.index(reward) for reward in rewards))
