"""What users choose of a driving benchmark, checked once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, cast

import jax.numpy as jnp

from hprs.carsim.designs import DESIGNS, load_track
from hprs.carsim.leader import GAP_THRESHOLD
from hprs.carsim.lidar import BEAMS, Lidar
from hprs.carsim.race import Settings
from hprs.carsim.random_track import random_track
from hprs.carsim.randomisation import RangesName, ranges
from hprs.carsim.track import SIGHT, Track, stack_tracks
from hprs.envs.driving.simulation import Simulation
from hprs.envs.options import count, number, switch
from hprs.errors import UsageError, did_you_mean

MAP_SUFFIXES = (".yaml", ".yml")
"""How the name of a map file ends."""
RANDOM = "random:"
"""What a seed of a random track stands behind."""
STARTS = ("random", "grid")
"""Places of a start."""


@dataclass(frozen=True)
class Options:
    """Of a driving benchmark."""

    tracks: str | Sequence[str]
    """Names of built-in tracks, `random:SEED`, or map files; each episode draws one."""
    horizon: int
    """Control steps after which an episode is truncated."""
    cars: Literal[1, 2] = 1
    """2 for a car and its leader."""
    stacked: int = 1
    """Scans and speeds in an observation."""
    reverse: bool = False
    """Drive the tracks the other way round."""
    randomisation: bool | str = True
    """Vary car, sensors and actuators; or a name of `hprs.carsim.randomisation.ranges`."""
    start: str = "random"
    """`random`: anywhere on the track; `grid`: at the start line."""
    beams: int = BEAMS
    """Of the lidar, over the same 270 degrees."""
    gap_threshold: float = GAP_THRESHOLD
    """Distance in m beyond which the leader takes a beam for a gap."""


def simulate(defaults: Options, **changes: Any) -> Simulation:
    """The simulation of a benchmark with some options changed.

    Raises:
        UsageError: There is no such option, or it has no such value.
        TrackError: A map file cannot be read or driven.
    """
    known = [field.name for field in fields(Options) if field.name != "cars"]
    for name in changes:
        if name not in known:
            raise UsageError(f"There is no option '{name}'.{did_you_mean(name, known)}")
    options = replace(defaults, **changes)
    settings = Settings(
        cars=options.cars,
        start=_start(options.start),
        ranges=_ranges(options.randomisation),
        threshold=_threshold(options.gap_threshold),
    )
    return Simulation(
        tracks=_stack(_names(options.tracks), switch("reverse", options.reverse)),
        settings=settings,
        horizon=jnp.asarray(count("horizon", options.horizon), jnp.int32),
        beams=Lidar(beams=count("beams", options.beams)).beams,
        stacked=count("stacked", options.stacked),
    )


def _start(value: Any) -> Literal["random", "grid"]:
    if value not in STARTS:
        hint = did_you_mean(str(value), STARTS)
        raise UsageError(f"start is one of {', '.join(STARTS)}, not {value!r}.{hint}")
    return cast(Literal["random", "grid"], value)


def _ranges(value: Any) -> Any:
    if isinstance(value, bool):
        value = "all" if value else "nominal"
    if not isinstance(value, str):
        raise UsageError(f"randomisation is True, False or a name of ranges, not {value!r}.")
    found = ranges(cast(RangesName, value))
    return replace(found, low=jnp.asarray(found.low), high=jnp.asarray(found.high))


def _threshold(value: Any) -> Any:
    distance = number("gap_threshold", value)
    if not 0 < distance < SIGHT:
        raise UsageError(
            f"gap_threshold needs a distance in m above 0 and below {SIGHT:g}, got {value!r}."
        )
    return jnp.asarray(distance, jnp.float32)


def _names(value: Any) -> tuple[str, ...]:
    names = (value,) if isinstance(value, str | Path) else value
    if not isinstance(names, Sequence) or not names:
        raise UsageError(
            f"tracks is a name or a list of names, not {value!r}. Known: {', '.join(DESIGNS)}, "
            f"{RANDOM}SEED, or a map's YAML file."
        )
    return tuple(str(name) for name in names)


def _stack(names: tuple[str, ...], reverse: bool) -> Track:
    return stack_tracks([_load(name, reverse) for name in names])


def _load(name: str, reverse: bool) -> Track:
    if not name.endswith(MAP_SUFFIXES):
        return _made(name, reverse)
    # Reading maps needs more libraries than driving does.
    from hprs.carsim.map_file import load_map

    return load_map(name, reverse=reverse)


@lru_cache(maxsize=32)
def _made(name: str, reverse: bool) -> Track:
    """A track that no file can change."""
    if name.startswith(RANDOM):
        seed = name.removeprefix(RANDOM)
        if not seed.isdecimal():
            raise UsageError(f"'{name}' needs a whole number as its seed, as in {RANDOM}7.")
        return random_track(int(seed), reverse=reverse)
    return load_track(name, reverse=reverse)
