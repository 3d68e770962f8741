"""The paper's results, from its tables."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any, NamedTuple

from hprs.training.toml_text import parse_toml

_FILE = "published.toml"


class Offline(NamedTuple):
    """A row of the table "offline evaluation"."""

    safe: float
    safe_target: float
    padded_comfort: float
    """S+T+C with comfort counted as violated from the end of an episode up to the longest one."""


class Wish(NamedTuple):
    """A row of the table "ablation on comfort": how often a requirement held."""

    mean: float
    deviation: float
    mean_without: float
    """With a reward that leaves comfort out."""
    deviation_without: float


def offline(environment: str) -> Mapping[str, Offline]:
    """Reward to its row; none for what the paper did not train."""
    return {name: Offline(*row) for name, row in _tables("offline", environment).items()}


def ablation(environment: str) -> Mapping[str, Wish]:
    """Label of a comfort requirement to its row."""
    return {name: Wish(*row) for name, row in _tables("ablation", environment).items()}


def unlike(environment: str) -> str:
    """What differs between the paper's benchmark and ours."""
    return _published()["unlike"].get(environment, "")


def _tables(name: str, environment: str) -> Mapping[str, Any]:
    return _published()[name].get(environment, {})


@cache
def _published() -> Mapping[str, Any]:
    text = resources.files("hprs.experiments").joinpath(_FILE).read_text(encoding="utf-8")
    return parse_toml(text, _FILE)
