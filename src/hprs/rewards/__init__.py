"""Rewards derived from a task: one per file, all of one shape, found by name in one registry."""

from hprs.rewards.base import Reward as Reward
from hprs.rewards.environment import EnvironmentReward as EnvironmentReward
from hprs.rewards.hierarchical import ENDS as ENDS
from hprs.rewards.hierarchical import Hierarchical as Hierarchical
from hprs.rewards.registry import REWARDS as REWARDS
from hprs.rewards.registry import make_reward as make_reward
from hprs.rewards.sparse import Sparse as Sparse

__all__ = [
    "ENDS",
    "REWARDS",
    "EnvironmentReward",
    "Hierarchical",
    "Reward",
    "Sparse",
    "make_reward",
]
