"""`hprs drive`: a policy on a car."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from hprs.deploy.command import DEAD_MAN_BUTTON
from hprs.errors import UsageError


@dataclass(frozen=True)
class Drive:
    """Drive a car with a policy: scans and odometry in, speed and steering out, at 10 Hz.

    The car waits until a dead-man switch is held. It is stopped, and stays so, when a scan or the
    odometry is missing or stale, the policy is late or answers what cannot be obeyed, or a safety
    requirement is violated. This is no emergency stop: keep the one of the car's own stack. Where
    hprs is not installed, the runtime that `hprs export` writes does the same.

    Examples:
      hprs drive policy.bundle --ros1
      hprs drive policy.bundle --ros1 --max-speed 1 --log drive.csv
      hprs drive policy.bundle --ros1 --dead-man-button 4 --lidar-ahead 0.27
    """

    bundle: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="BUNDLE")]
    """A policy bundle, as `hprs export` writes it."""
    ros1: bool = False
    """Over ROS 1: /scan and /odom in, /drive out, /joy for the dead-man switch."""
    max_speed: Annotated[float | None, tyro.conf.arg(metavar="M/S", help_behavior_hint="")] = None
    """Never ask the car for more; default: as in training."""
    scan_age: Annotated[float | None, tyro.conf.arg(metavar="S", help_behavior_hint="")] = None
    """Stop where the newest scan is older; default: 0.2, and a lidar of 5 Hz needs more."""
    log: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """A CSV file of the drive, which `hprs assess` reads."""
    dead_man_button: Annotated[int, tyro.conf.arg(metavar="N")] = DEAD_MAN_BUTTON
    """Number of the button in /joy that must be held; -1: none, where nobody can be hurt."""
    lidar_ahead: Annotated[float | None, tyro.conf.arg(metavar="M", help_behavior_hint="")] = None
    """How far the lidar sits before the rear axle; default: as in training."""
    lidar_left: Annotated[float, tyro.conf.arg(metavar="M")] = 0.0
    """How far it sits to the left of the middle."""
    lidar_yaw: Annotated[float, tyro.conf.arg(metavar="RAD")] = 0.0
    """How far it is turned to the left."""
    upside_down: bool = False
    """It hangs upside down."""

    def run(self) -> int:
        """Drive until interrupted."""
        from hprs.deploy.command import main

        if not self.ros1:
            raise UsageError("name what the car speaks: --ros1.")
        arguments = [str(self.bundle), "--ros1", "--dead-man-button", str(self.dead_man_button)]
        for option, value in (
            ("--max-speed", self.max_speed),
            ("--scan-age", self.scan_age),
            ("--log", self.log),
            ("--lidar-ahead", self.lidar_ahead),
            ("--lidar-left", self.lidar_left),
            ("--lidar-yaw", self.lidar_yaw),
        ):
            if value is not None:
                arguments += [option, str(value)]
        return main(arguments + ["--upside-down"] * self.upside_down)
