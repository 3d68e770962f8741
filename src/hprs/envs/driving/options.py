"""What users choose of a driving benchmark, checked once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from inspect import Parameter, signature
from pathlib import Path
from typing import Any, Literal, TypeAlias, TypeVar, cast

import jax.numpy as jnp
import numpy as np

from hprs.carsim.designs import DESIGNS, load_track
from hprs.carsim.faults import FAULTS, Faults
from hprs.carsim.leader import GAP_THRESHOLD
from hprs.carsim.lidar import BEAMS, Lidar
from hprs.carsim.race import Settings
from hprs.carsim.random_track import random_track
from hprs.carsim.randomisation import RangesName, narrowed, ranges
from hprs.carsim.track import SIGHT, Track, stack_tracks
from hprs.envs.driving.simulation import Simulation
from hprs.envs.options import count, number, switch
from hprs.errors import UsageError, did_you_mean

TrackLike: TypeAlias = str | Path | Track | Sequence[str | Path]
"""A built-in track, `random:SEED`, several (`random:0-15`), a map file, `map.yaml+line.csv` or that
pair, or a track; ` backwards` behind a name turns it round."""
Environment = TypeVar("Environment", bound=type)

MAP_SUFFIXES = (".yaml", ".yml")
"""How the name of a map file ends."""
LINE_SUFFIX = ".csv"
"""How the name of a centre line's file ends."""
RANDOM = "random:"
"""What a seed of a random track stands behind."""
BACKWARDS = " backwards"
"""Behind the name of a track that is driven the other way round."""
MOST_RANDOM = 100
"""Random tracks that one name may stand for: each takes a while to make."""
STARTS = ("random", "grid")
"""Places of a start."""


@dataclass(frozen=True)
class Options:
    """Of a driving benchmark."""

    tracks: TrackLike | Sequence[TrackLike]
    """One or several, of which each episode draws one."""
    horizon: int
    """Control steps after which an episode is truncated."""
    cars: Literal[1, 2] = 1
    """2 for a car and its leader."""
    stacked: int = 1
    """Scans and speeds in an observation."""
    reverse: bool = False
    """Drive the tracks the other way round."""
    randomisation: bool | str | Mapping[str, Any] = True
    """Vary car, sensors and actuators; or a name of `hprs.carsim.randomisation.ranges`; or all of
    them with other values or [low, high] for some quantities, by name."""
    start: str = "random"
    """`random`: anywhere on the track; `grid`: at the start line."""
    beams: int = BEAMS
    """Of the lidar, over the same 270 degrees."""
    reach: float = SIGHT
    """Of the lidar, m: a Hokuyo UST-10LX on a real car sees 10."""
    gap_threshold: float = GAP_THRESHOLD
    """Distance in m beyond which the leader takes a beam for a gap."""
    dropped_scans: float = Faults.dropped_scans
    """Probability that a scan is lost, and the one before stays."""
    speed_scale: float = Faults.speed_scale
    """Factor of the measured speed."""
    speed_offset: float = Faults.speed_offset
    """Added to the measured speed, m/s."""


def simulate(defaults: Options, **changes: Any) -> Simulation:
    """The simulation of a benchmark with some options changed.

    Raises:
        UsageError: There is no such option, or it has no such value.
        TrackError: A map file cannot be read or driven.
    """
    _check_names(changes, [*_names_of(defaults), "horizon"], defaults)
    options = replace(defaults, **changes)
    settings = Settings(
        cars=options.cars,
        start=_start(options.start),
        ranges=_ranges(options.randomisation),
        threshold=_threshold(options.gap_threshold),
        lidar=Lidar(beams=count("beams", options.beams), reach=number("reach", options.reach)),
        faults=_faults(options),
    )
    return Simulation(
        tracks=_stack(options.tracks, switch("reverse", options.reverse)),
        settings=settings,
        horizon=jnp.asarray(count("horizon", options.horizon), jnp.int32),
        stacked=count("stacked", options.stacked),
    )


def simulate_single(defaults: Options, **changes: Any) -> Simulation:
    """The simulation of a single environment, whose episodes Gymnasium cuts off.

    Raises:
        UsageError: There is no such option, or it has no such value.
        TrackError: A map file cannot be read or driven.
    """
    refuse_horizon(changes)
    _check_names(changes, [*_names_of(defaults), "camera", "render_mode"], defaults)
    return simulate(defaults, **changes)


def refuse_horizon(changes: Iterable[str]) -> None:
    """Refuse our name of what Gymnasium's environments are told by Gymnasium's.

    Raises:
        UsageError: It is there.
    """
    if "horizon" in changes:
        raise UsageError("There is no option 'horizon' here. Use max_episode_steps.")


def lists_options(defaults: Options) -> Callable[[Environment], Environment]:
    """Decorates a single environment's class: its signature lists what `**options` may hold.

    Who reads signatures (help, `hprs train --env`) finds the options without a second declaration.
    """

    def listed(kind: Environment) -> Environment:
        plain = signature(kind.__init__)
        own = [p for p in plain.parameters.values() if p.kind is not Parameter.VAR_KEYWORD]
        own += [
            Parameter(name, Parameter.KEYWORD_ONLY, default=getattr(defaults, name))
            for name in _names_of(defaults)
        ]
        vars(kind)["__init__"].__signature__ = plain.replace(parameters=own)
        return kind

    return listed


def _names_of(defaults: Options) -> list[str]:
    """Options that every form of a benchmark has."""
    absent = {"cars", "horizon"} | ({"gap_threshold"} if defaults.cars == 1 else set())
    return [field.name for field in fields(Options) if field.name not in absent]


def _check_names(changes: Iterable[str], known: Sequence[str], defaults: Options) -> None:
    for name in changes:
        if name == "gap_threshold" and defaults.cars == 1:
            raise UsageError("There is no option 'gap_threshold' here: it is a leader's.")
        if name not in known:
            raise UsageError(f"There is no option '{name}'.{did_you_mean(name, known)}")


def _start(value: Any) -> Literal["random", "grid"]:
    if value not in STARTS:
        hint = did_you_mean(str(value), STARTS)
        raise UsageError(f"start is one of {', '.join(STARTS)}, not {value!r}.{hint}")
    return cast(Literal["random", "grid"], value)


def _ranges(value: Any) -> Any:
    if isinstance(value, bool):
        value = "all" if value else "nominal"
    changes = value if isinstance(value, Mapping) else {}
    name = "all" if isinstance(value, Mapping) else value
    if not isinstance(name, str):
        raise UsageError(
            "randomisation is True, False or a name of ranges, or ranges by quantity, "
            f"not {value!r}."
        )
    found = narrowed(
        ranges(cast(RangesName, name)), {key: _ends(key, given) for key, given in changes.items()}
    )
    return replace(found, low=jnp.asarray(found.low), high=jnp.asarray(found.high))


def _ends(name: str, given: Any) -> tuple[float, float]:
    """A range of a quantity: of one number, itself."""
    ends = given if isinstance(given, list | tuple) else (given, given)
    if len(ends) != 2:
        raise UsageError(f"randomisation needs a number or [low, high] of {name}, got {given!r}.")
    low, high = (number(f"randomisation of {name}", end) for end in ends)
    return low, high


def _faults(options: Options) -> Faults | None:
    """Faults as arrays, which share a compilation; None where there are none."""
    given: dict[str, float] = {}
    for fault in FAULTS:
        given[fault.name] = number(fault.name, getattr(options, fault.name))
        if not fault.least <= given[fault.name] <= fault.greatest:
            raise UsageError(
                f"{fault.name} is a number from {fault.least:g} to {fault.greatest:g}, "
                f"got {given[fault.name]:g}."
            )
    if all(given[fault.name] == fault.neutral for fault in FAULTS):
        return None
    return Faults(**{name: jnp.asarray(value, jnp.float32) for name, value in given.items()})


def _threshold(value: Any) -> Any:
    distance = number("gap_threshold", value)
    if not 0 < distance < SIGHT:
        raise UsageError(
            f"gap_threshold needs a distance in m above 0 and below {SIGHT:g}, got {value!r}."
        )
    return jnp.asarray(distance, jnp.float32)


def _stack(value: Any, reverse: bool) -> Track:
    return stack_tracks([_load(one, reverse) for one in _listed(value)])


def track_names(tracks: TrackLike | Sequence[TrackLike]) -> list[str]:
    """Names of the tracks that an option stands for; a loaded `Track` has none.

    Raises:
        UsageError: It stands for no tracks.
    """
    return [
        "+".join(map(str, one)) if _is_pair(one) else str(one)
        for one in _listed(tracks)
        if not isinstance(one, Track)
    ]


def _listed(value: Any) -> Sequence[Any]:
    """Tracks one by one."""
    if isinstance(value, str | Path | Track) or _is_pair(value):
        value = (value,)
    if isinstance(value, Sequence) and value:
        return [track for one in value for track in _several(one)]
    raise _no_track(value)


def _several(value: Any) -> Sequence[Any]:
    """The tracks of `random:FIRST-LAST`; of anything else, itself."""
    if not isinstance(value, str) or not value.startswith(RANDOM):
        return (value,)
    plain = value.removesuffix(BACKWARDS)
    backwards = value[len(plain) :]
    first, dash, last = plain.removeprefix(RANDOM).partition("-")
    if not dash:
        return (value,)
    if not (first.isdecimal() and last.isdecimal() and int(first) <= int(last)):
        raise UsageError(f"'{value}' needs its first and its last seed, as in {RANDOM}0-15.")
    if int(last) - int(first) >= MOST_RANDOM:
        raise UsageError(f"'{value}' is more than {MOST_RANDOM} tracks.")
    return [f"{RANDOM}{seed}{backwards}" for seed in range(int(first), int(last) + 1)]


def _is_pair(value: Any) -> bool:
    """Whether it is a map's file and a centre line's, and not two tracks."""
    return (
        isinstance(value, Sequence)
        and len(value) == 2
        and all(isinstance(part, str | Path) for part in value)
        and str(value[0]).endswith(MAP_SUFFIXES)
        and str(value[1]).endswith(LINE_SUFFIX)
    )


def _load(track: Any, reverse: bool) -> Track:
    if isinstance(track, Track):
        return _given(track, reverse)
    if isinstance(track, str) and track.endswith(BACKWARDS):
        return _load(track.removesuffix(BACKWARDS), not reverse)
    if not isinstance(track, str | Path) and not _is_pair(track):
        raise _no_track(track)
    path, line = _files(str(track)) if isinstance(track, str | Path) else map(str, track)
    if not path.endswith(MAP_SUFFIXES):
        return _made(path, reverse)
    # Reading maps needs more libraries than driving does.
    from hprs.carsim.map_file import load_map

    return load_map(path, centre_line=line, reverse=reverse)


def _files(name: str) -> tuple[str, str | None]:
    """A name, and the centre line behind the last `+` that follows a map's file."""
    for suffix in MAP_SUFFIXES:
        path, plus, line = name.rpartition(f"{suffix}+")
        if plus and line.endswith(LINE_SUFFIX):
            return path + suffix, line
    if name.endswith(LINE_SUFFIX):
        raise UsageError(f"'{name}' is a centre line; write it behind its map: map.yaml+line.csv.")
    return name, None


def _given(track: Track, reverse: bool) -> Track:
    if reverse:
        raise UsageError(
            "reverse is no option of a Track that is loaded: load it with reverse=True."
        )
    if np.ndim(track.length) != 0:
        raise UsageError("A Track here is one track, not a stack; give a list of tracks.")
    if track.centre.dtype != np.float32:
        raise UsageError(f"A Track is driven in float32, not {track.centre.dtype}: load it so.")
    return track


def _no_track(value: Any) -> UsageError:
    return UsageError(
        f"tracks is a name or a list of names, not {value!r:.80}. Known: {', '.join(DESIGNS)}, "
        f"{RANDOM}SEED, {RANDOM}FIRST-LAST, a map's YAML file, map.yaml+line.csv, "
        "(map.yaml, line.csv), a Track."
    )


@lru_cache(maxsize=2 * MOST_RANDOM)
def _made(name: str, reverse: bool) -> Track:
    """A track that no file can change."""
    if name.startswith(RANDOM):
        seed = name.removeprefix(RANDOM)
        if not seed.isdecimal():
            raise UsageError(f"'{name}' needs a whole number as its seed, as in {RANDOM}7.")
        return random_track(int(seed), reverse=reverse)
    return load_track(name, reverse=reverse)
