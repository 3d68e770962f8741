"""The command line of the runtime, where hprs is not installed."""

from __future__ import annotations

import argparse
import sys
from typing import Any, List, Optional, Sequence

from hprs.deploy.archive import load_bundle
from hprs.deploy.bundle import Bundle
from hprs.deploy.driving import Driving, unknown_signals
from hprs.deploy.loop import ControlLoop, Limits
from hprs.deploy.monitor import Monitor
from hprs.deploy.record import Record
from hprs.deploy.ros1 import drive_ros1
from hprs.deploy.scan import Mounting
from hprs.errors import HprsError, UsageError

DEAD_MAN_BUTTON = 4
"""Of a joystick, where the user names no other."""


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Check a policy bundle and say what it is; with --ros1, drive a car with it.

    Returns:
        The exit code: 0 done, 1 the bundle is wrong, 2 the call is wrong, 130 interrupted.
    """
    given = _parser().parse_args(arguments)
    try:
        bundle = load_bundle(given.bundle)
        bundle.self_check()
        if given.ros1:
            return _drive(bundle, given)
        _tell("\n".join(description(bundle)))
    except HprsError as error:
        sys.stderr.write("hprs: {}\n".format(error))
        return 2 if isinstance(error, UsageError) else 1
    return 0


def description(bundle: Bundle) -> List[str]:
    """What a bundle is, line by line."""
    found = bundle.provenance
    requirements = [one["label"] for one in bundle.task.get("requirements", [])]
    rate = "not said" if not bundle.rate else "{:g} Hz".format(bundle.rate)
    return [
        "environment    {}".format(found.get("environment", "not said")),
        "trained by     {}, step {}".format(
            found.get("written_by", "not said"), found.get("step", "not said")
        ),
        "observation    shape {}".format(bundle.observation.shape),
        "action         shape {}".format(bundle.action.shape),
        "rate           {}".format(rate),
        "requirements   {}".format(", ".join(requirements) or "none"),
        "self-check     passed",
    ]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=(main.__doc__ or "").partition("\n")[0])
    add = parser.add_argument
    add("bundle", metavar="BUNDLE", help="a policy bundle")
    add("--ros1", action="store_true", help="drive: /scan, /odom and /joy in, /drive out")
    add("--max-speed", type=float, metavar="M/S", help="never ask the car for more")
    add(
        "--scan-age",
        type=float,
        default=Limits.scan_age,
        metavar="S",
        help="stop where the newest scan is older (default: %(default)s)",
    )
    add("--log", metavar="FILE", help="a CSV file of the drive")
    add(
        "--dead-man-button",
        type=int,
        default=DEAD_MAN_BUTTON,
        metavar="N",
        help="of /joy, that must be held; -1: none (default: %(default)s)",
    )
    add("--lidar-ahead", type=float, metavar="M", help="of the rear axle; default: as in training")
    add("--lidar-left", type=float, default=0.0, metavar="M", help="of the middle of the car")
    add("--lidar-yaw", type=float, default=0.0, metavar="RAD", help="to the left")
    add("--upside-down", action="store_true", help="the lidar hangs upside down")
    return parser


def _drive(bundle: Bundle, given: Any) -> int:
    """Drive a car until interrupted."""
    if given.max_speed is not None and not given.max_speed > 0:
        raise UsageError("--max-speed must be above 0, not {:g}.".format(given.max_speed))
    if not given.scan_age > 0:
        raise UsageError("--scan-age must be above 0, not {:g}.".format(given.scan_age))
    fastest = Limits.speed if given.max_speed is None else given.max_speed
    driving, monitor = Driving.of(bundle), Monitor(bundle.task)
    ahead = driving.beams.ahead if given.lidar_ahead is None else given.lidar_ahead
    loop = ControlLoop(
        bundle,
        mounting=Mounting(ahead, given.lidar_left, given.lidar_yaw, given.upside_down),
        limits=Limits(speed=fastest, scan_age=given.scan_age),
        dead_man=given.dead_man_button >= 0,
        record=None if given.log is None else Record(given.log, monitor.signals, monitor.labels),
    )
    foreign = unknown_signals(list(monitor.signals))
    if foreign:
        _tell("unknown unless published: {}".format(", ".join(foreign)))
    try:
        drive_ros1(loop, given.dead_man_button, _tell)
    except KeyboardInterrupt:
        return 130
    finally:
        loop.close()
    return 0


def _tell(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()
