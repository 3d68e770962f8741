"""Rewards derived from a task: one per file, all of one shape, found by name in one registry."""

from hprs.rewards.base import Demands as Demands
from hprs.rewards.base import Reward as Reward
from hprs.rewards.base import components_of as components_of
from hprs.rewards.base import demands_of as demands_of
from hprs.rewards.bhnr import WindowRobustness as WindowRobustness
from hprs.rewards.hierarchical import Hierarchical as Hierarchical
from hprs.rewards.pam import EpisodeAssessment as EpisodeAssessment
from hprs.rewards.rank_preserving import RankPreserving as RankPreserving
from hprs.rewards.registry import REWARDS as REWARDS
from hprs.rewards.registry import make_reward as make_reward
from hprs.rewards.scalarized import Scalarized as Scalarized
from hprs.rewards.shaping import ENDS as ENDS
from hprs.rewards.state import StateReward as StateReward
from hprs.rewards.state import environment_reward as environment_reward
from hprs.rewards.state import safety_cost as safety_cost
from hprs.rewards.state import sparse as sparse
from hprs.rewards.tltl import EpisodeRobustness as EpisodeRobustness
from hprs.rewards.vector import RequirementVector as RequirementVector

__all__ = [
    "ENDS",
    "REWARDS",
    "Demands",
    "EpisodeAssessment",
    "EpisodeRobustness",
    "Hierarchical",
    "RankPreserving",
    "RequirementVector",
    "Reward",
    "Scalarized",
    "StateReward",
    "WindowRobustness",
    "components_of",
    "demands_of",
    "environment_reward",
    "make_reward",
    "safety_cost",
    "sparse",
]
