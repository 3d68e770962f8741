"""Observations and commands of a driving policy, as its bundle describes them."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any, Deque, Dict, List, Mapping, NamedTuple, Sequence, Tuple

import numpy as np

from hprs.deploy.bundle import Bundle
from hprs.deploy.scan import Beams
from hprs.errors import BundleError

KIND = "driving"
"""What a bundle's details call observations and actions of a car."""
STANDING = (0.0, -1.0)
"""The command before the first one: straight wheels, no speed."""
_OUT_OF_RANGE = 1e-5
"""By which an action may leave [-1, 1]: rounding."""


class Asked(NamedTuple):
    """A command, in units of a car."""

    speed: float
    """m/s."""
    steering_angle: float
    """Of the front wheels, rad, positive to the left."""


@dataclass(frozen=True)
class Part:
    """A part of an observation."""

    name: str
    history: int
    """How many of them, oldest first."""
    width: int
    """Numbers in one."""
    low: float
    """What is observed as -1."""
    high: float
    """What is observed as 1."""

    def seen(self, values: Sequence[Any]) -> np.ndarray:
        """Its numbers in an observation."""
        numbers = np.asarray(values, np.float32).ravel()
        if (self.low, self.high) == (-1.0, 1.0):
            return numbers
        return 2 * (numbers - np.float32(self.low)) / np.float32(self.high - self.low) - 1


@dataclass(frozen=True)
class Driving:
    """How a policy's observations are built, and what its actions ask for."""

    parts: Tuple[Part, ...]
    beams: Beams
    speed_change: float
    """Of the speed command by an action of 1, m/s."""
    max_speed: float
    """Of a command, m/s."""
    speed_gain: float
    """Speed that the training's car reached, over the speed command."""
    steering_angle: float
    """Of the wheels at full left in training, rad."""
    steering_limit: float
    """Largest angle of the wheels, rad."""

    @staticmethod
    def of(bundle: Bundle) -> Driving:
        """What a bundle says.

        Raises:
            BundleError: It is not of a driving policy, or does not say how it drives.
        """
        seen, acts = bundle.observation.details, bundle.action.details
        for what, details in (("observations", seen), ("actions", acts)):
            if details.get("kind") != KIND:
                raise BundleError(
                    "this bundle does not say what its {} are on a car. If it was trained to "
                    "drive, complete it: "
                    "hprs export OLD.bundle NEW.bundle --environment ENV".format(what)
                )
        try:
            found = _driving(seen, acts)
        except (KeyError, TypeError, ValueError) as error:
            raise BundleError("its layout lacks a part: {!r}.".format(error)) from None
        size = sum(part.history * part.width for part in found.parts)
        if (size,) != bundle.observation.shape:
            raise BundleError(
                "its layout has {} numbers ({}), its observations shape {}.".format(
                    size,
                    ", ".join("{} {} x {}".format(p.name, p.history, p.width) for p in found.parts),
                    bundle.observation.shape,
                )
            )
        if bundle.action.shape != (2,):
            raise BundleError(
                "a command is a change of speed and a steering, shape (2,); its actions have "
                "shape {}.".format(bundle.action.shape)
            )
        return found

    def memory(self) -> Memory:
        """A memory of a car that stands, before its first reading."""
        return Memory(self)

    def asked(self, command: Tuple[float, float]) -> Asked:
        """What a normalised command asks of the car that was trained with."""
        steering, speed = command
        angle = steering * self.steering_angle
        return Asked(
            speed=(speed + 1) / 2 * self.max_speed * self.speed_gain,
            steering_angle=min(max(angle, -self.steering_limit), self.steering_limit),
        )

    def normalised_speed(self, speed: float) -> float:
        """The command that asks for a speed in m/s, at most 1."""
        return min(1.0, 2 * speed / (self.max_speed * self.speed_gain) - 1)


def _driving(seen: Mapping[str, Any], acts: Mapping[str, Any]) -> Driving:
    parts = tuple(_part(one) for one in seen["parts"])
    names = [part.name for part in parts]
    if names != ["commands", "scans", "speeds"]:
        raise ValueError("commands, scans and speeds, not {}".format(", ".join(names)))
    lidar = seen["lidar"]
    return Driving(
        parts=parts,
        beams=Beams(
            count=parts[1].width,
            first=float(lidar["first_angle"]),
            last=float(lidar["last_angle"]),
            reach=float(lidar["reach"]),
            ahead=float(lidar["ahead_of_rear_axle"]),
        ),
        speed_change=float(acts["speed_change"]),
        max_speed=float(acts["max_speed"]),
        speed_gain=float(acts["speed_gain"]),
        steering_angle=float(acts["steering_angle"]),
        steering_limit=float(acts["steering_limit"]),
    )


def _part(content: Mapping[str, Any]) -> Part:
    width = content["components"]
    return Part(
        name=content["name"],
        history=int(content["history"]),
        width=int(width) if isinstance(width, int) else len(width),
        low=float(content.get("low", -1.0)),
        high=float(content.get("high", 1.0)),
    )


class Memory:
    """The last commands, scans and speeds, and the observation that they make.

    Args:
        driving: The layout.
    """

    def __init__(self, driving: Driving) -> None:
        self._driving = driving
        self.commands: Deque[Tuple[float, float]] = deque(
            [STANDING] * max(2, driving.parts[0].history)
        )
        self._scans: Deque[np.ndarray] = deque(maxlen=driving.parts[1].history)
        self._speeds: Deque[float] = deque(maxlen=driving.parts[2].history)

    def sense(self, distances: np.ndarray, speed: float) -> None:
        """Remember a scan of the policy's beams, m, and a speed, m/s; the first one fills all."""
        for history, value in ((self._scans, distances), (self._speeds, speed)):
            for _ in range(1 if history else int(history.maxlen or 1)):
                history.append(value)  # type: ignore[arg-type]

    def observation(self) -> np.ndarray:
        """What the policy sees."""
        commands, scans, speeds = self._driving.parts
        newest = list(self.commands)[-commands.history :]
        seen = [commands.seen(newest), scans.seen(self._scans), speeds.seen(self._speeds)]
        return np.clip(np.concatenate(seen), -1.0, 1.0)

    def obey(self, action: Any, speed_limit: float) -> str:
        """Add the command that an action makes of the last one.

        Args:
            action: Change of speed and steering.
            speed_limit: Of what is asked of the car, m/s.

        Returns:
            Why it cannot be obeyed; an empty text if it can.
        """
        change, steering = map(float, action)
        if not (np.isfinite(change) and np.isfinite(steering)):
            return "the policy's action is ({}, {})".format(change, steering)
        if max(abs(change), abs(steering)) > 1 + _OUT_OF_RANGE:
            return "the policy's action ({:g}, {:g}) is outside [-1, 1]".format(change, steering)
        d = self._driving
        speed = self.commands[-1][1] + 2 * d.speed_change / d.max_speed * change
        speed = min(max(speed, -1.0), d.normalised_speed(speed_limit))
        self.commands.append((min(max(steering, -1.0), 1.0), speed))
        self.commands.popleft()
        return ""

    def signals(self, speed: float) -> Dict[str, float]:
        """The signals of a driving task that a car knows without localisation."""
        (last_steering, last_speed), (steering, command) = list(self.commands)[-2:]
        return {
            "speed": speed,
            "steering": steering,
            "speed_command": command,
            "last_steering": last_steering,
            "last_speed_command": last_speed,
        }


def unknown_signals(names: Sequence[str]) -> List[str]:
    """Those of a task's signals that a car does not know by itself."""
    known = {"speed", "steering", "speed_command", "last_steering", "last_speed_command"}
    return [name for name in names if name not in known]
