"""How a car looks: within its outline, with front wheels that steer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hprs.carsim.body import BODY
from hprs.carsim.vehicle import VehicleParameters
from hprs.envs.driving.rendering.canvas import Colour, Points, Shape, View

_TYRE: Colour = (24, 26, 31)
_GLASS: Colour = (30, 34, 42)
_SHADOW: Colour = (10, 12, 18, 70)
_TYRE_LENGTH, _TYRE_WIDTH = 0.12, 0.058
_FRONT = float(VehicleParameters.front_axle)
_REAR = -float(VehicleParameters.rear_axle)
_TRACK = BODY.width / 2 - _TYRE_WIDTH / 2
_LEAST_LENGTH = 20.0
"""A car is drawn at least so long, in pixels, however far it is away."""


def _mirrored(half: Sequence[tuple[float, float]]) -> Points:
    """A closed line from its left half, front to back."""
    points = np.array(half)
    return np.concatenate([points, points[::-1] * (1, -1)])


def _rectangle(length: float, width: float, middle: tuple[float, float] = (0.0, 0.0)) -> Points:
    signs = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)])
    return signs * np.array([length, width]) / 2 + np.array(middle)


_END = BODY.length / 2
_HULL = _mirrored(
    [(_END - 0.012, 0.022), (_END - 0.07, 0.04), (0.1, 0.055), (0.05, 0.115), (-0.02, 0.13),
     (-0.09, 0.125), (-0.13, 0.075), (-0.23, 0.06), (-_END + 0.02, 0.05)]
)  # fmt: skip
_COCKPIT = _mirrored([(0.085, 0.012), (0.07, 0.036), (0.0, 0.045), (-0.06, 0.038), (-0.08, 0.014)])
_STRIPE = _mirrored([(_END - 0.02, 0.008), (0.1, 0.014)])
_FRONT_WING = _rectangle(0.045, BODY.width - 0.03, (_END - 0.0225, 0.0))
_REAR_WING = _rectangle(0.05, BODY.width - 0.06, (-_END + 0.025, 0.0))


def car_shapes(
    view: View, pose: Points, wheels: float, *, colour: Colour, dark: Colour
) -> list[Shape]:
    """A car.

    Args:
        view: What is seen.
        pose: Centre of mass and heading x, y, yaw, (3,).
        wheels: Angle of the front wheels, rad.
        colour: Of its body.
        dark: Of its wings.
    """
    size = max(1.0, _LEAST_LENGTH / (BODY.length * view.scale))
    shapes: list[Shape] = []

    def put(shape: Points, fill: Colour, shift: Points | float = 0.0) -> None:
        shapes.append((pose[:2] + (_turned(shape, float(pose[2])) + shift) * size, fill))

    # The light stands still while the world turns.
    shadow = 0.03 * np.array([np.cos(view.up - 2.2), np.sin(view.up - 2.2)])
    for shape in (_HULL, _FRONT_WING, _REAR_WING):
        put(shape, _SHADOW, shadow)
    tyre = _rectangle(_TYRE_LENGTH, _TYRE_WIDTH)
    for side in (-_TRACK, _TRACK):
        put(_rectangle(0.02, abs(side), (_FRONT, side / 2)), _TYRE)
        put(_rectangle(0.02, abs(side), (_REAR, side / 2)), _TYRE)
        put(tyre + np.array([_REAR, side]), _TYRE)
        put(_turned(tyre, wheels) + np.array([_FRONT, side]), _TYRE)
    put(_FRONT_WING, dark)
    put(_HULL, colour)
    put(_STRIPE, (255, 255, 255, 200))
    put(_REAR_WING, dark)
    put(_COCKPIT, _GLASS)
    return shapes


def _turned(shape: Points, angle: float) -> Points:
    cosine, sine = np.cos(angle), np.sin(angle)
    return shape @ np.array([[cosine, sine], [-sine, cosine]])
