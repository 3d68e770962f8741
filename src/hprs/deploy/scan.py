"""From any lidar's readings to the beams that a policy was trained with."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, Tuple

import numpy as np

from hprs.errors import BundleError

_JUMP = 1.3
"""Neighbouring readings that differ by more than this factor are of two things, not of one wall:
on one wall, a quarter of a degree apart, they do not up to 15 m."""
_CLOSEST = 1e-3
"""Smallest reading that is inverted, m."""
_SLACK = 1e-4
"""By which a scan may end before the policy's last beam, rad."""


class Scan(NamedTuple):
    """One message of a lidar, as ROS has it in `sensor_msgs/LaserScan`."""

    ranges: Any
    """Readings in m, (N,): NaN where nothing is known, inf where nothing is within reach, -inf
    where something is nearer than it can measure (REP 117)."""
    angle_min: float
    """Of the first reading from the sensor's own forward axis, rad, positive to the left."""
    angle_increment: float
    """Between two readings, rad; negative where they run clockwise."""
    range_min: float = 0.0
    """Readings below are no readings, m."""
    range_max: float = math.inf
    """Readings above say that nothing is within reach, m."""


@dataclass(frozen=True)
class Mounting:
    """Where the lidar sits on this car; the axes are the car's, from the middle of the rear axle.

    Raises:
        BundleError: A number is not finite.
    """

    ahead: float
    """m."""
    left: float = 0.0
    """m."""
    yaw: float = 0.0
    """Its forward axis from the car's, rad, positive to the left."""
    upside_down: bool = False
    """Its left is the car's right."""

    def __post_init__(self) -> None:
        """Raise BundleError where a number is not finite."""
        for name in ("ahead", "left", "yaw"):
            value = getattr(self, name)
            if not math.isfinite(value):
                raise BundleError("the lidar's mounting: {} is {}.".format(name, value))


@dataclass(frozen=True)
class Beams:
    """Of the lidar that a policy was trained with."""

    count: int
    first: float
    """Angle from straight ahead, rad, positive to the left."""
    last: float
    reach: float
    """Largest reading, m."""
    ahead: float
    """Of the rear axle, m."""

    @property
    def angles(self) -> np.ndarray:
        """Of all beams, (count,)."""
        return np.linspace(self.first, self.last, self.count)

    @property
    def spacing(self) -> float:
        """Between two beams, rad."""
        return abs(self.last - self.first) / max(1, self.count - 1)


def refusal(scan: Scan, beams: Beams, mounting: Mounting) -> str:
    """Why a lidar cannot serve a policy; an empty text if it can."""
    count = len(scan.ranges)
    if count < 2 or not (math.isfinite(scan.angle_min) and math.isfinite(scan.angle_increment)):
        return "a scan of {} readings from {} rad on is no scan".format(count, scan.angle_min)
    if scan.angle_increment == 0:
        return "a scan whose readings all have one angle is no scan"
    ends = _car_angles(np.array([0.0, count - 1.0]), scan, mounting)
    low, high = float(min(ends)), float(max(ends))
    if high - low > 2 * math.pi - 2 * abs(scan.angle_increment):
        return ""
    wanted = sorted((beams.first, beams.last))
    if low > wanted[0] + _SLACK or high < wanted[1] - _SLACK:
        return (
            "this lidar sees from {:.1f} to {:.1f} degrees, the policy from {:.1f} to {:.1f}"
        ).format(*map(math.degrees, (low, high, wanted[0], wanted[1])))
    return ""


def resample(scan: Scan, beams: Beams, mounting: Mounting) -> np.ndarray:
    """What the policy's own lidar would have read.

    Between two neighbouring readings of one wall a beam is interpolated in inverse distance, which
    is exact on a straight wall as far as their angle is small; between two things it takes the one
    that is nearer in angle. Where the lidar reaches less far than the policy's, its own reach is
    what a beam without an echo reads.

    Args:
        scan: The readings; it must not be refused by `refusal`.
        beams: The policy's.
        mounting: Of this car's lidar.

    Returns:
        Distances in m, (count,); NaN where no reading is within half the policy's spacing.
    """
    angles, distances = _known(scan, beams, mounting)
    wanted = beams.angles
    if not len(angles):
        return np.full(len(wanted), np.nan)
    # A whole turn: what stands at one end is also beyond the other one.
    angles = np.concatenate([angles[-1:] - 2 * math.pi, angles, angles[:1] + 2 * math.pi])
    distances = np.concatenate([distances[-1:], distances, distances[:1]])
    after = np.clip(np.searchsorted(angles, wanted), 1, len(angles) - 1)
    before = after - 1
    to_before, to_after = wanted - angles[before], angles[after] - wanted
    gap = np.maximum(angles[after] - angles[before], 1e-12)
    near, far = distances[before], distances[after]
    nearest = np.where(to_before <= to_after, near, far)
    share = np.clip(to_before / gap, 0.0, 1.0)
    inverse = (1 - share) / np.maximum(near, _CLOSEST) + share / np.maximum(far, _CLOSEST)
    window = max(beams.spacing / 2, abs(scan.angle_increment))
    one_wall = np.maximum(near, far) <= _JUMP * np.maximum(np.minimum(near, far), _CLOSEST)
    smooth = one_wall & (gap <= 2 * window)
    found = np.where(smooth, 1 / inverse, nearest)
    found[np.minimum(np.abs(to_before), np.abs(to_after)) > window] = np.nan
    return np.minimum(found, beams.reach)


def _known(scan: Scan, beams: Beams, mounting: Mounting) -> Tuple[np.ndarray, np.ndarray]:
    """Angles, increasing, and distances of all readings, as from the policy's own lidar."""
    ranges = np.asarray(scan.ranges, np.float64)
    reach = min(scan.range_max, beams.reach)
    with np.errstate(invalid="ignore"):
        nothing = np.logical_or(ranges > scan.range_max, np.isposinf(ranges))
        too_near = np.isneginf(ranges)
        known = np.logical_or.reduce([nothing, too_near, ranges >= scan.range_min])
    places = np.flatnonzero(known)
    distances = np.where(nothing, reach, np.where(too_near, scan.range_min, ranges))[places]
    angles = _car_angles(places.astype(float), scan, mounting)
    ahead, left = mounting.ahead - beams.ahead, mounting.left
    if ahead or left:
        x = ahead + distances * np.cos(angles)
        y = left + distances * np.sin(angles)
        # What has no echo has no place either.
        moved = np.where(nothing[places], distances, np.hypot(x, y))
        angles = np.where(nothing[places], angles, np.arctan2(y, x))
        distances = moved
    angles = np.mod(angles + math.pi, 2 * math.pi) - math.pi
    order = np.argsort(angles, kind="stable")
    return angles[order], distances[order]


def _car_angles(places: np.ndarray, scan: Scan, mounting: Mounting) -> np.ndarray:
    """Angles of readings from straight ahead, positive to the left."""
    angles = scan.angle_min + places * scan.angle_increment
    return mounting.yaw + (-angles if mounting.upside_down else angles)
