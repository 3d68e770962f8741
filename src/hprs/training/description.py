"""What a bundle says of a policy's observations and actions, beyond their shapes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import gymnasium as gym

from hprs.deploy import Bundle
from hprs.spec.task import Source, Task


class Details(NamedTuple):
    """JSON values of a bundle."""

    observation: dict[str, Any]
    action: dict[str, Any]


def details_of(environment: gym.Env[Any, Any], task: Task) -> Details:
    """What is known of an environment's observations and actions.

    An environment may say itself what they are made of, in its attributes `observation_details`
    and `action_details`; what the task reads from them has names and units in any case.

    Args:
        environment: With its wrappers.
        task: Its task.
    """
    bare = environment.unwrapped
    observation = dict(getattr(bare, "observation_details", {}))
    action = dict(getattr(bare, "action_details", {}))
    for content, root in ((observation, "obs"), (action, "action")):
        signals = _signals(task, root)
        if signals:
            content["signals"] = signals
    return Details(observation, action)


def described(bundle: Bundle, details: Details) -> Bundle:
    """A bundle that says them."""
    return replace(
        bundle,
        observation=replace(bundle.observation, details=details.observation),
        action=replace(bundle.action, details=details.action),
    )


def _signals(task: Task, root: str) -> list[dict[str, Any]]:
    """The signals that a task reads from observations or actions, with their places and units."""
    return [
        {"name": signal.name, "place": _place(signal.source), "unit": signal.unit}
        for signal in task.signals
        if signal.source is not None and signal.source.root == root
    ]


def _place(source: Source) -> str:
    """Where a signal is read, as in a task's text: `[3]`, `.pose[0:2]`."""
    keys = "".join(f".{key}" for key in source.keys)
    if source.index is None:
        return keys
    if isinstance(source.index, int):
        return f"{keys}[{source.index}]"
    first, last = ("" if end is None else str(end) for end in source.index)
    return f"{keys}[{first}:{last}]"
