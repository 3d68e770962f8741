"""Runs the shell blocks of the documentation, with the budgets of a test."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path

from hprs.cli import main
from tests.docs.blocks import ROOT, Block

CAPS: Mapping[str, tuple[str, ...]] = {
    "train": ("--steps", "4_096", "--evaluate-every", "4_096"),
    "evaluate": ("--episodes", "2"),
    "compare": ("--episodes", "2"),
    "report": ("--no-pictures",),
}
"""What a command gets as well; of an option that is said twice the last one counts."""


def commands_of(block: Block) -> Iterator[list[str]]:
    """The words of each command that is executed."""
    left_out = block.rules.get("except", "").partition(": ")[0].split(" | ")
    for line in block.text.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        if words and not any(starts(words, with_) for with_ in left_out if with_):
            yield words


def starts(words: list[str], with_: str) -> bool:
    """Whether a command starts so; a $ stands for its end."""
    return f"{' '.join(words).removeprefix('hprs ')}$".startswith(with_)


def run_command(words: list[str], block: Block, run: Path) -> None:
    """Run one command of `hprs` in this process; RUN is the run at hand.

    Raises:
        ValueError: It is another program's.
    """
    if words[0] != "hprs":
        raise ValueError(
            f"{block.place}: '{words[0]}' is not run here; say '<!-- not run: REASON -->' above."
        )
    arguments = [str(run) if word in ("RUN", "RUN/seed-0") else word for word in words[1:]]
    arguments += caps(arguments)
    arguments += shlex.split(block.rules.get("run with", "")) if arguments[0] == "train" else []
    code = main(arguments)
    assert code == 0, f"{block.place}: {shlex.join(words)} ends with {code}"


def caps(arguments: list[str]) -> tuple[str, ...]:
    """The budget of a command; a log has no horizon to shorten, a resumed training no steps."""
    recorded = any(word.endswith((".csv", ".parquet", ".bag")) for word in arguments)
    if "--resume" in arguments or recorded:
        return ()
    fewer = ("--episodes", "2") if "--episodes" in arguments else ()
    return (*CAPS.get(arguments[0], ()), *fewer)


def furnish(folder: Path) -> None:
    """What the pages speak of lies in the folder in which their commands run."""
    for name in ("examples", "results", "src"):
        (folder / name).symlink_to(ROOT / name)
    task = (ROOT / "src/hprs/envs/cart_pole/task.hprs").read_text("utf-8")
    for name in ("cartpole.hprs", "my_task.hprs"):
        (folder / name).write_text(task, "utf-8")
    for name in ("pendulum.hprs", "drone.hprs"):
        (folder / name).write_text((ROOT / "examples" / name).read_text("utf-8"), "utf-8")
    (folder / "log.csv").write_text(
        "time,x,v,theta\n0,0,0,0\n0.02,0.5,0.6,0.06\n0.04,1,0.2,0\n", "utf-8"
    )
    bundle = ROOT / "results/policies/safe-driving/policy.bundle"
    (folder / "policy.bundle").write_bytes(bundle.read_bytes())
