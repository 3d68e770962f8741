"""Rewards derived from a task: one per file, all of one shape, found by name in one registry."""

from hprs.rewards.base import Reward as Reward
from hprs.rewards.base import StateReward as StateReward
from hprs.rewards.environment import environment_reward as environment_reward
from hprs.rewards.hierarchical import ENDS as ENDS
from hprs.rewards.hierarchical import Hierarchical as Hierarchical
from hprs.rewards.registry import REWARDS as REWARDS
from hprs.rewards.registry import make_reward as make_reward
from hprs.rewards.sparse import sparse as sparse

__all__ = [
    "ENDS",
    "REWARDS",
    "Hierarchical",
    "Reward",
    "StateReward",
    "environment_reward",
    "make_reward",
    "sparse",
]
