"""Rewards, training and assessment from a task's safety, target and comfort requirements.

Everything is loaded on first use, so that a robot that runs a policy pays for NumPy alone.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hprs import deploy as deploy
    from hprs.rewards.registry import make_reward as make_reward
    from hprs.semantics.assessment import assess as assess
    from hprs.semantics.assessment import summarise as summarise
    from hprs.spec.expression import call as call
    from hprs.spec.json_format import task_from_json as task_from_json
    from hprs.spec.json_format import task_to_json as task_to_json
    from hprs.spec.parser import load_task as load_task
    from hprs.spec.parser import parse_task as parse_task
    from hprs.spec.printer import format_task as format_task
    from hprs.spec.task import Constant as Constant
    from hprs.spec.task import Definition as Definition
    from hprs.spec.task import Preference as Preference
    from hprs.spec.task import Requirement as Requirement
    from hprs.spec.task import Signal as Signal
    from hprs.spec.task import Source as Source
    from hprs.spec.task import Task as Task
    from hprs.wrappers.single import wrap as wrap
    from hprs.wrappers.vector import wrap_vector as wrap_vector

_HOMES = {
    "Constant": "hprs.spec.task",
    "Definition": "hprs.spec.task",
    "Preference": "hprs.spec.task",
    "Requirement": "hprs.spec.task",
    "Signal": "hprs.spec.task",
    "Source": "hprs.spec.task",
    "Task": "hprs.spec.task",
    "assess": "hprs.semantics.assessment",
    "call": "hprs.spec.expression",
    "format_task": "hprs.spec.printer",
    "load_task": "hprs.spec.parser",
    "make_reward": "hprs.rewards.registry",
    "parse_task": "hprs.spec.parser",
    "summarise": "hprs.semantics.assessment",
    "task_from_json": "hprs.spec.json_format",
    "task_to_json": "hprs.spec.json_format",
    "wrap": "hprs.wrappers.single",
    "wrap_vector": "hprs.wrappers.vector",
}

__all__ = [
    "Constant",
    "Definition",
    "Preference",
    "Requirement",
    "Signal",
    "Source",
    "Task",
    "assess",
    "call",
    "deploy",
    "format_task",
    "load_task",
    "make_reward",
    "parse_task",
    "summarise",
    "task_from_json",
    "task_to_json",
    "wrap",
    "wrap_vector",
]


def __getattr__(name: str) -> Any:
    if name == "deploy":
        return importlib.import_module("hprs.deploy")
    if name not in _HOMES:
        raise AttributeError(f"module 'hprs' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
