"""Says how many numbers a reward pays, where MO-Gymnasium and its learners look for it.

They read `env.unwrapped.reward_space`, so it has to stand on an environment that is the user's, and
that other wrappers may be put on later. A wrapper whose `unwrapped` gave something else than this
environment would mislead everyone who changes its state. So the environment says what its newest
wrapper pays: the next wrapper replaces it, also by nothing, and closing takes it off.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.spaces import Box

from hprs.rewards.base import Reward, components_of

_ATTRIBUTES = ("reward_space", "reward_dim")


class ComponentSpace(Box):
    """The space of a reward's components; its class tells it from an environment's own."""

    def __init__(self, count: int) -> None:
        super().__init__(-np.inf, np.inf, (count,), np.float64)


def announce_components(wrapper: Any, reward: Reward) -> None:
    """Say how many numbers a reward pays, on a wrapper and on the innermost environment."""
    bare, labels = wrapper.unwrapped, components_of(reward)
    if labels is None:
        if isinstance(vars(bare).get("reward_space"), ComponentSpace):
            _take_off(bare)
        return
    space = ComponentSpace(len(labels))
    for environment in (wrapper, bare):
        environment.reward_space, environment.reward_dim = space, len(labels)


def withdraw_components(wrapper: Any) -> None:
    """Take off the innermost environment what a wrapper has announced there, if it still stands."""
    own = vars(wrapper).get("reward_space")
    if own is not None and vars(wrapper.unwrapped).get("reward_space") is own:
        _take_off(wrapper.unwrapped)


def _take_off(bare: Any) -> None:
    for name in _ATTRIBUTES:
        delattr(bare, name)
