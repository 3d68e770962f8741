"""Where on a track each comfort requirement of safe driving can be met, along its centre line.

    .venv/bin/python benchmarks/centre_lines.py [TRACK ...]

One line is one track and one steering gain: those of the domain randomisation are 0.5 to 0.75. All
numbers but the last follow from the track alone, by the steady state of the simulator's car: no
driver is simulated. `benchmarks/drivers.py` tells what drivers reach.
"""

from __future__ import annotations

import sys

import numpy as np

from hprs.carsim.actuators import MAX_SPEED_COMMAND, STEERING_SCALE
from hprs.carsim.designs import DESIGNS
from hprs.carsim.geometry import Points, curvature, point_distances, resample
from hprs.carsim.race import CONTROL_STEP
from hprs.carsim.randomisation import QUANTITIES
from hprs.carsim.track import Track
from hprs.carsim.vehicle import VehicleParameters
from hprs.envs import functional, task_of
from hprs.envs.driving.simulation import SPEED_CHANGE

SAFE = "hprs/SafeDriving-v0"
CONSTANTS = {each.name: float(each.value.value) for each in task_of(SAFE).constants}
CAR = VehicleParameters()
PLACES = 256
RANGES = {quantity.name: (quantity.low, quantity.high) for quantity in QUANTITIES}


def steering_of(bend: Points, speed: float, gain: float) -> Points:
    """The steady steering command, 1 for all the way, that drives a curvature (1/m) at a speed."""
    # What the tyres at the front slip more than those at the rear (linear below the limit).
    slip = (1 / CAR.front_stiffness - 1 / CAR.rear_stiffness) / (CAR.friction * CAR.gravity)
    return (np.arctan(CAR.wheelbase * bend) + slip * speed**2 * bend) / (STEERING_SCALE * gain)


def percent(flags: Points) -> str:
    """How much of the lap."""
    return f"{100 * np.mean(flags):.0f} %"


def lines_of(name: str, track: Track) -> None:
    """Print the lines of a track."""
    walls = np.asarray(track.walls, float)
    centre = np.asarray(track.centre, float)
    gaps = point_distances(centre, walls).min(axis=1) / float(track.max_clearance)
    (places,) = resample(centre, PLACES)
    bend, length, slow = curvature(places), float(track.length), CONSTANTS["speed_min"]
    # The weakest grip of the randomisation holds a car of this speed in the tightest bend.
    grip = RANGES["friction"][0] * RANGES["gravity"][0]
    fastest = np.sqrt(grip / np.maximum(np.abs(bend), 1e-9))
    step = round(slow * CONTROL_STEP / (length / PLACES))
    for gain in RANGES["steering_gain"]:
        steering = steering_of(bend, slow, gain)
        change = np.abs(np.roll(steering, -step) - steering)
        print(
            f"{name}, {gain}",
            percent(gaps >= CONSTANTS["clearance_target"]),
            f"{gaps.min():.2f}",
            percent(fastest >= slow),
            f"{fastest.min():.1f} m/s",
            percent(np.abs(steering) <= CONSTANTS["steering_limit"]),
            percent(np.abs(steering) <= 1),
            f"{np.abs(steering).max():.2f}",
            percent(change <= CONSTANTS["command_change"]),
            f"{change.max():.2f}",
            sep=" | ",
        )


print(
    "track, steering gain", "centred", "least clearance", "fast", "fastest in the tightest bend",
    "straight", "can be steered", "largest steering", "smooth", "largest change",
    sep=" | ",
)  # fmt: skip
for each in sys.argv[1:] or list(DESIGNS):
    tracks = functional.make(SAFE, tracks=each).tracks
    lines_of(each, Track(**{key: value[0] for key, value in vars(tracks).items()}))
start = -(-CONSTANTS["speed_min"] // SPEED_CHANGE)
print(
    f"\nFrom standing, {CONSTANTS['speed_min']:g} m/s are commanded after {start:.0f} steps; each "
    f"changes the speed command by {2 * SPEED_CHANGE / MAX_SPEED_COMMAND:.3f}, which is smooth up "
    f"to {CONSTANTS['command_change']:g}."
)
