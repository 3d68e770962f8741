"""What a driving policy is tested under: data, derived from the simulator's own tables.

A perturbation is one thing that is changed while everything else is as in the training: a
randomised quantity (`hprs.carsim.randomisation.QUANTITIES`), a fault of the sensors
(`hprs.carsim.faults.FAULTS`), or the track.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import count, islice
from typing import Any

import jax
import numpy as np
from jax import Array

from hprs.carsim.designs import DESIGNS, load_track
from hprs.carsim.faults import FAULTS, Faults
from hprs.carsim.race import Settings
from hprs.carsim.random_track import random_track
from hprs.carsim.randomisation import QUANTITIES, Quantity, Ranges, narrowed
from hprs.carsim.track import Track
from hprs.carsim.vehicle import TIME_STEP
from hprs.envs.driving.options import BACKWARDS, RANDOM
from hprs.errors import UsageError, did_you_mean

AS_TRAINED = "as trained"
"""The point at which nothing is changed."""
TRACK = "track"
"""The perturbation of tracks."""
GENERATED = 20
"""Generated tracks of a test."""
FIRST_GENERATED = 1000
"""Seed of the first of them; trainings count theirs from 0."""

_MILLISECONDS = 1000 * TIME_STEP
_SHOWN = {"delay": ("latency", "ms", _MILLISECONDS)}
"""Quantity to the name, the unit and the factor under which people know it."""


@partial(
    jax.tree_util.register_dataclass, data_fields=["ranges", "faults", "track"], meta_fields=[]
)
@dataclass(frozen=True)
class Conditions:
    """What episodes run under; leaves may have a leading axis, of points."""

    ranges: Ranges
    faults: Faults
    track: Array | np.ndarray | None = None
    """Number of the track, () int32; None draws it."""


@dataclass(frozen=True)
class Point:
    """One value of one perturbation."""

    perturbation: str
    value: str
    """As it is shown."""
    unit: str
    trained: bool
    """Whether the policy was trained with it."""
    conditions: Conditions


@dataclass(frozen=True)
class NamedTrack:
    """A track of the test."""

    name: str
    track: Track


def perturbations() -> dict[str, tuple[float, ...]]:
    """Name of every perturbation that is a number to the values of its test."""
    found: dict[str, tuple[float, ...]] = {}
    for quantity in QUANTITIES:
        name, _, factor = _shown(quantity)
        found[name] = tuple(round(value * factor, 6) for value in quantity.tested)
    return found | {fault.name: fault.tested for fault in FAULTS}


def points(settings: Settings, sweeps: Mapping[str, Sequence[float]]) -> list[Point]:
    """The points of some sweeps, behind the one that changes nothing.

    Args:
        settings: Of the worlds in which the policy was trained.
        sweeps: Name of a perturbation to its values.

    Raises:
        UsageError: There is no such perturbation, or a value is impossible.
    """
    usual = Conditions(settings.ranges, settings.faults or _no_faults())
    found = [Point(AS_TRAINED, "", "", trained=True, conditions=usual)]
    quantities = {_shown(quantity)[0]: quantity for quantity in QUANTITIES}
    faults = {fault.name: fault for fault in FAULTS}
    for name, values in sweeps.items():
        if name in quantities:
            found += [_quantity(usual, quantities[name], value) for value in values]
        elif name in faults:
            found += [_fault(usual, name, value) for value in values]
        else:
            known = [*quantities, *faults]
            raise UsageError(
                f"There is no perturbation '{name}'.{did_you_mean(name, known)} "
                f"There are {', '.join(known)}, and {TRACK}."
            )
    return found


def _quantity(usual: Conditions, quantity: Quantity, value: float) -> Point:
    name, unit, factor = _shown(quantity)
    real = value / factor
    row = QUANTITIES.index(quantity)
    low, high = (float(ends[row]) for ends in (usual.ranges.low, usual.ranges.high))
    ranges = narrowed(usual.ranges, {quantity.name: (real, real)})
    # What the simulator rounds to single precision is no other value.
    slack = 1e-6 * max(abs(low), abs(high), 1e-6)
    trained = low - slack <= real <= high + slack
    return Point(name, f"{value:g}", unit, trained, replace(usual, ranges=ranges))


def _fault(usual: Conditions, name: str, value: float) -> Point:
    fault = next(fault for fault in FAULTS if fault.name == name)
    if not fault.least <= value <= fault.greatest:
        raise UsageError(
            f"{name} is a number from {fault.least:g} to {fault.greatest:g}, got {value:g}."
        )
    trained = np.float32(value) == np.float32(getattr(usual.faults, name))
    faults = replace(usual.faults, **{name: np.float32(value)})
    return Point(name, f"{value:g}", fault.unit, bool(trained), replace(usual, faults=faults))


def tracks_of_test(seen: Sequence[str]) -> list[NamedTrack]:
    """The built-in tracks both ways, and generated ones, half of them backwards.

    None of the generated ones is among those seen, whichever way.

    Args:
        seen: Names of the tracks of the trainings.
    """
    found = [
        NamedTrack(name + BACKWARDS * reverse, load_track(name, reverse=reverse))
        for reverse in (False, True)
        for name in DESIGNS
    ]
    known = {name.removesuffix(BACKWARDS) for name in seen}
    unseen = (seed for seed in count(FIRST_GENERATED) if f"{RANDOM}{seed}" not in known)
    for number, seed in enumerate(islice(unseen, GENERATED)):
        # They all turn left in the end: the second half turns right.
        reverse = number >= GENERATED // 2
        name = f"{RANDOM}{seed}{BACKWARDS * reverse}"
        found.append(NamedTrack(name, random_track(seed, reverse=reverse)))
    return found


def track_points(
    settings: Settings, tracks: Sequence[NamedTrack], seen: Sequence[str]
) -> list[Point]:
    """One point a track.

    Args:
        settings: Of the worlds in which the policy was trained.
        tracks: The tracks, in the order of the stack that is driven.
        seen: Names of the tracks of its training.
    """
    usual = Conditions(settings.ranges, settings.faults or _no_faults())
    return [
        Point(TRACK, each.name, "", each.name in seen, replace(usual, track=np.int32(number)))
        for number, each in enumerate(tracks)
    ]


def stacked(chosen: Sequence[Point]) -> Conditions:
    """The conditions of some points, with a leading axis; all of them name a track, or none."""
    return jax.tree.map(
        lambda *leaves: np.stack([np.asarray(leaf) for leaf in leaves]),
        *[point.conditions for point in chosen],
    )


def _no_faults() -> Faults:
    values: dict[str, Any] = {fault.name: np.float32(fault.neutral) for fault in FAULTS}
    return Faults(**values)


def _shown(quantity: Quantity) -> tuple[str, str, float]:
    return _SHOWN.get(quantity.name, (quantity.name, quantity.unit, 1.0))
