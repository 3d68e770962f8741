"""The subcommands, and how their arguments are parsed."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Mapping, Sequence
from functools import reduce
from operator import or_
from types import MappingProxyType
from typing import Annotated, Any, Protocol

import tyro

_DESCRIPTION = """Rewards, training and assessment from a short list of ranked requirements.

Examples:
  hprs check my_task.hprs                     is this task right?
  hprs tasks                                  the built-in benchmarks
  hprs train hprs/CartPole-v0                 train a policy; writes below runs/
  hprs evaluate RUN                           how well does it meet each requirement?
  hprs assess log.csv --task my_task.hprs     the same for a recorded log
  hprs explain RUN                            what earned or cost what, step by step
  hprs watch RUN                              a video with each requirement's state on it
  hprs compare RUN RUN                        two policies on the same episodes
  hprs benchmark GRID.toml                    a whole study: rewards, environments, seeds
  hprs report RUNS                            curves, tables and one page of many runs
  hprs robustness RUN                         a driving policy under what it never saw
  hprs export RUN policy.bundle               files that run without hprs, as on a robot
"""

COMMANDS: Mapping[str, str] = MappingProxyType(
    {
        "check": "Check",
        "tasks": "Tasks",
        "train": "Train",
        "evaluate": "Evaluate",
        "assess": "Assess",
        "explain": "Explain",
        "watch": "Watch",
        "compare": "Compare",
        "benchmark": "Benchmark",
        "report": "Report",
        "robustness": "Robustness",
        "export": "Export",
    }
)
"""Subcommand to its class, which lives in the module of the same name; in the order of the help."""


class Command(Protocol):
    """What a subcommand's arguments become."""

    def run(self) -> int:
        """Do it, and return the exit code."""
        ...


def parse(arguments: Sequence[str]) -> Command:
    """The command that a command line asks for.

    Raises:
        SystemExit: The arguments are wrong (2), or help was printed (0).
    """
    config = (tyro.conf.OmitArgPrefixes, tyro.conf.FlagCreatePairsOff)
    if arguments and arguments[0] in COMMANDS:
        command = _load(arguments[0])
        return tyro.cli(
            command,
            prog=f"hprs {arguments[0]}",
            description=inspect.getdoc(command),
            args=list(arguments[1:]),
            config=config,
        )
    union: Any = reduce(or_, (_subcommand(name) for name in COMMANDS))
    return tyro.cli(
        union, prog="hprs", description=_DESCRIPTION, args=list(arguments), config=config
    )


def _subcommand(name: str) -> Any:
    command = _load(name)
    summary, _, _ = (inspect.getdoc(command) or "").partition("\n")
    return Annotated[command, tyro.conf.subcommand(name, description=summary, prefix_name=False)]


def _load(name: str) -> Any:
    return getattr(importlib.import_module(f"hprs.cli.{name}"), COMMANDS[name])
