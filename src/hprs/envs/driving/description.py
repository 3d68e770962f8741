"""What observations and actions of a driving benchmark are made of, as JSON: for a real car.

`hprs.deploy.driving` builds the same observations out of what a real car measures.
"""

from __future__ import annotations

from typing import Any

from hprs.carsim.actuators import (
    MAX_SPEED_COMMAND,
    STEERING_LIMIT,
    STEERING_SCALE,
    ActuatorParameters,
)
from hprs.carsim.lidar import beam_angles
from hprs.carsim.track import SIGHT
from hprs.carsim.vehicle import VehicleParameters
from hprs.deploy.driving import KIND
from hprs.envs.driving.simulation import (
    REMEMBERED_COMMANDS,
    SPEED_CHANGE,
    SPEED_SCALE,
    Simulation,
)


def observation_details(simulation: Simulation) -> dict[str, Any]:
    """Parts of an observation in their order, each oldest first and mapped to [-1, 1]."""
    lidar = simulation.settings.lidar
    angles = beam_angles(lidar)
    return {
        "kind": KIND,
        "parts": [
            {
                "name": "commands",
                "history": REMEMBERED_COMMANDS,
                "components": ["steering", "speed"],
                "unit": "normalised command: steering 1 is full left, speed -1 is 0",
            },
            {
                "name": "scans",
                "history": simulation.stacked,
                "components": lidar.beams,
                "unit": "m",
                "low": 0.0,
                "high": SIGHT,
            },
            {
                "name": "speeds",
                "history": simulation.stacked,
                "components": ["forward speed"],
                "unit": "m/s",
                "low": 0.0,
                "high": SPEED_SCALE,
            },
        ],
        "lidar": {
            "first_angle": float(angles[0]),
            "last_angle": float(angles[-1]),
            "unit": "rad from straight ahead, positive to the left",
            "reach": float(lidar.reach),
            "ahead_of_rear_axle": float(lidar.ahead + float(VehicleParameters.rear_axle)),
        },
    }


def action_details() -> dict[str, Any]:
    """What an action changes, and what a command asks of a car."""
    angle = STEERING_SCALE * float(ActuatorParameters.steering_gain)
    return {
        "kind": KIND,
        "components": ["change of the speed command", "steering"],
        "speed_change": SPEED_CHANGE,
        "max_speed": MAX_SPEED_COMMAND,
        "speed_gain": float(ActuatorParameters.speed_gain),
        "steering_angle": angle,
        "steering_limit": STEERING_LIMIT,
        "unit": "m/s an action of 1; m/s; m/s reached over m/s asked; rad of full left; rad",
    }
