"""A grid of trainings as typed data, and the file that says it.

A grid is a list of blocks. A block trains every combination of its environments, rewards, ends,
algorithms and seeds; what one block does not say, the table `[defaults]` says for all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any, cast

from hprs.errors import GridError, HprsError, UsageError, did_you_mean
from hprs.experiments.values import check_keys, count, seeds, string, strings, table
from hprs.rewards.registry import REWARDS
from hprs.rewards.shaping import End
from hprs.spec.task_file import read_text
from hprs.training.configuration import Configuration
from hprs.training.configure import configure
from hprs.training.toml_text import parse_toml

BLOCKS, DEFAULTS = "runs", "defaults"


@dataclass(frozen=True)
class Block:
    """Trainings that are every combination of something."""

    environments: tuple[str, ...]
    """Benchmarks, Gymnasium ids, or `module:id`."""
    rewards: tuple[str, ...] = (Configuration.reward,)
    """Names of `REWARDS`."""
    ends: tuple[str, ...] = (Configuration.end,)
    """End-of-episode conventions; rewards without shaping are trained once."""
    algorithms: tuple[str | None, ...] = (None,)
    """Names of `ALGORITHMS`; None: the default one."""
    seeds: tuple[int, ...] = (0,)
    """Seeds of the trainings."""
    trainer: str | None = None
    """A key of `TRAINERS`; None: the first that has the algorithm."""
    task: str | None = None
    """A task file, relative to the grid's; None: the benchmark's own task."""
    constants: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """Other values for constants of the task."""
    steps: int | None = None
    """Environment steps of a training; None: the benchmark's."""
    horizon: int | None = None
    """Steps after which an episode ends; None: the environment's own horizon."""
    evaluate_every: int | None = None
    """Environment steps between two evaluations; None: the trainer's."""
    settings: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """Hyper-parameters that differ from the benchmark's."""
    environment_options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """Options of the environments."""
    reward_options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """Options of the rewards."""


@dataclass(frozen=True)
class Grid:
    """What is to be trained."""

    path: Path
    """The file that says it."""
    blocks: tuple[Block, ...]


_READERS: Mapping[str, tuple[str, Callable[[Any, str], Any]]] = {
    "environment": ("environments", strings),
    "reward": ("rewards", strings),
    "end": ("ends", strings),
    "algorithm": ("algorithms", strings),
    "seeds": ("seeds", seeds),
    "trainer": ("trainer", string),
    "task": ("task", string),
    "const": ("constants", table),
    "steps": ("steps", count),
    "horizon": ("horizon", count),
    "evaluate_every": ("evaluate_every", count),
    "set": ("settings", table),
    "env": ("environment_options", table),
    "reward_set": ("reward_options", table),
}
"""Key of a block, named like the option of `hprs train`, to its field and what reads it."""


def read_grid(path: Path) -> Grid:
    """The grid in a file.

    Raises:
        UsageError: There is no such file.
        GridError: It says something else than a grid.
    """
    if not path.is_file():
        near = [file.name for file in path.parent.glob("*.toml")]
        raise UsageError(f"there is no grid '{path}'.{did_you_mean(path.name, near)}")
    try:
        content = parse_toml(read_text(path), str(path))
    except UsageError as error:
        raise GridError(str(error)) from None
    check_keys(content, {BLOCKS: 0, DEFAULTS: 0}, str(path))
    defaults = content.get(DEFAULTS, {})
    blocks = content.get(BLOCKS, [])
    if not isinstance(blocks, list) or not blocks:
        raise GridError(f"{path}: it needs a block: [[{BLOCKS}]] on a line of its own.")
    shared = _fields(table(defaults, f"{path}: {DEFAULTS}"), f"{path}: {DEFAULTS}")
    return Grid(
        path,
        tuple(
            _block(table(block, f"{path}: {BLOCKS}"), shared, f"{path}: block {number}")
            for number, block in enumerate(blocks, 1)
        ),
    )


def configurations_of(grid: Grid) -> list[Configuration]:
    """Every training of a grid, checked; what two blocks ask for is there once.

    Raises:
        GridError: A name is unknown, a value out of range, or a task wrong.
    """
    found: dict[tuple[str, int], Configuration] = {}
    for number, block in enumerate(grid.blocks, 1):
        for configuration in _expand(block, grid.path, f"{grid.path}: block {number}"):
            for seed in block.seeds:
                found.setdefault((configuration.digest, seed), replace(configuration, seed=seed))
    return list(found.values())


def _expand(block: Block, path: Path, place: str) -> Iterator[Configuration]:
    task = None if block.task is None else str(path.parent / block.task)
    for environment, algorithm, reward in product(
        block.environments, block.algorithms, block.rewards
    ):
        shaped = reward not in REWARDS or REWARDS[reward].shaped
        # Another end would be the same training again.
        for end in block.ends if shaped else block.ends[:1]:
            try:
                yield configure(
                    environment,
                    task_path=task,
                    constants=block.constants,
                    reward=reward,
                    end=cast("End", end),
                    reward_options=_options_of(reward, block.reward_options),
                    algorithm=algorithm,
                    trainer=block.trainer,
                    settings=block.settings,
                    environment_options=block.environment_options,
                    steps=block.steps,
                    horizon=block.horizon,
                    evaluation_interval=block.evaluate_every,
                )
            except HprsError as error:
                raise GridError(f"{place}, {environment}, {reward}: {error}") from error


def _options_of(reward: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """The options that a reward has; where none of them is its own, none."""
    own = REWARDS[reward].options if reward in REWARDS else ()
    return {name: value for name, value in options.items() if name in own}


def _block(content: Mapping[str, Any], shared: Mapping[str, Any], place: str) -> Block:
    found = {**shared, **_fields(content, place)}
    if "environments" not in found:
        raise GridError(f"{place}: it names no environment.")
    block = Block(**found)
    known = {
        option for name in block.rewards if name in REWARDS for option in REWARDS[name].options
    }
    for option in block.reward_options:
        if option not in known:
            raise GridError(f"{place}: none of its rewards has the option '{option}'.")
    return block


def _fields(content: Mapping[str, Any], place: str) -> dict[str, Any]:
    check_keys(content, _READERS, place)
    found: dict[str, Any] = {}
    for key, value in content.items():
        name, read = _READERS[key]
        found[name] = read(value, f"{place}: '{key}'")
    return found
