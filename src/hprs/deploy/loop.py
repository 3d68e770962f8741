"""The control loop of a car, without a transport: what is heard goes in, commands come out.

It stops the car when it no longer knows what it does. That is no emergency stop: the car's own
stack keeps one, and it must win.
"""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass
from typing import Any, Callable, Deque, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from hprs.deploy.bundle import Bundle
from hprs.deploy.driving import Driving
from hprs.deploy.monitor import Monitor, Verdict, violated_safety
from hprs.deploy.record import Record
from hprs.deploy.scan import Mounting, Scan, refusal, resample
from hprs.errors import BundleError

WAITING, DRIVING, STOPPED = "waiting", "driving", "stopped"
"""Phases: nothing is driven yet or the dead-man switch is released; the policy drives; it was
stopped, and stays so until `ControlLoop.release`."""

_REMEMBERED = 100_000
"""Ticks whose times are kept, nearly three hours."""
_DEFAULT_RATE = 10.0


class Drive(NamedTuple):
    """What the car is told."""

    speed: float
    """m/s."""
    steering_angle: float
    """Of the front wheels, rad, positive to the left."""
    phase: str
    reason: str
    """Why nothing is driven; empty while driving."""


@dataclass(frozen=True)
class Limits:
    """Beyond which the car is stopped."""

    speed: float = float("inf")
    """What is asked of the car at most, m/s."""
    scan_age: float = 0.2
    """Of the newest scan, s."""
    odometry_age: float = 0.2
    """Of the newest speed, s."""
    decision: float = 0.05
    """That the policy may take, s."""
    tick: float = 0.1
    """That a tick may be late, s."""
    dead_man_age: float = 0.5
    """Of the newest word of the dead-man switch, s; the car waits after it."""
    unknown_beams: float = 0.1
    """Share of the policy's beams without a reading."""


class ControlLoop:
    """One policy on one car.

    Messages may be handed in from other threads; ticks and checks come from one.

    Args:
        bundle: The policy; it is checked first.
        mounting: Of the car's lidar; None: as in training.
        limits: Beyond which the car is stopped.
        dead_man: Whether a switch must be held for the car to drive.
        record: Where to log; it gets a row for every state that is driven.
        clock: Seconds, increasing.

    Raises:
        BundleError: The bundle does not check itself, or is not of a driving policy.
    """

    def __init__(
        self,
        bundle: Bundle,
        *,
        mounting: Optional[Mounting] = None,
        limits: Limits = Limits(),
        dead_man: bool = True,
        record: Optional[Record] = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        bundle.self_check()
        self.driving = Driving.of(bundle)
        self.monitor = Monitor(bundle.task)
        self.clock, self.limits = clock, limits
        self.period = 1 / (bundle.rate or _DEFAULT_RATE)
        self.verdicts: List[Verdict] = []
        self.lateness: Deque[float] = deque(maxlen=_REMEMBERED)
        self.decisions: Deque[float] = deque(maxlen=_REMEMBERED)
        self._bundle, self._record = bundle, record
        self._mounting = mounting or Mounting(self.driving.beams.ahead)
        self._needs_dead_man = dead_man
        self._scan: Optional[Tuple[float, Scan]] = None
        self._speed: Optional[Tuple[float, float]] = None
        self._held: Tuple[float, bool] = (-float("inf"), False)
        self._signals: Mapping[str, Any] = {}
        self._memory = self.driving.memory()
        self._phase, self._reason = WAITING, "nothing was heard yet"
        self._angle = 0.0
        self._ticked = clock()

    def hear_scan(self, scan: Scan) -> None:
        """Take the newest scan."""
        self._scan = (self.clock(), scan)

    def hear_speed(self, speed: float) -> None:
        """Take the newest forward speed, m/s, as odometry has it."""
        self._speed = (self.clock(), float(speed))

    def hear_dead_man(self, held: bool) -> None:
        """Take the newest word of the dead-man switch."""
        self._held = (self.clock(), bool(held))

    def hear_signals(self, signals: Mapping[str, Any]) -> None:
        """Take signals of the task that the car does not know by itself, as of localisation."""
        self._signals = {**self._signals, **signals}

    def release(self) -> None:
        """Let a stopped car drive again, from standing."""
        self._wait("released")

    def tick(self, due: Optional[float] = None) -> Drive:
        """Decide once.

        Args:
            due: When the tick was to be; None: now.
        """
        now = self.clock()
        late = 0.0 if due is None else now - due
        self.lateness.append(late)
        self._ticked = now
        if self._phase == STOPPED:
            return self._told()
        waiting = self._why_waiting(now)
        if waiting:
            self._wait(waiting)
            return self._told()
        if self._phase == WAITING:
            self._begin()
        elif late > self.limits.tick:
            self._stop("a tick was {:.0f} ms late".format(1e3 * late))
        return self._decided(now, late)

    def check(self) -> Optional[Drive]:
        """See between two ticks whether the car must be stopped; if so, the command that does."""
        now = self.clock()
        if self._phase != DRIVING:
            return None
        trouble = self._silence(now)
        if not trouble and now - self._ticked > self.period + self.limits.tick:
            trouble = "no tick for {:.0f} ms".format(1e3 * (now - self._ticked))
        if trouble:
            self._stop(trouble)
        elif self._is_released(now):
            self._wait("the dead-man switch is released")
        return None if self._phase == DRIVING else self._told()

    def close(self) -> None:
        """Close the log."""
        if self._record is not None:
            self._record.close()

    def _why_waiting(self, now: float) -> str:
        if self._is_released(now):
            return "the dead-man switch is released"
        if self._phase == DRIVING:
            return ""
        if self._scan is None or self._speed is None:
            return "no scan yet" if self._scan is None else "no odometry yet"
        return self._silence(now)

    def _is_released(self, now: float) -> bool:
        then, held = self._held
        return self._needs_dead_man and not (held and now - then <= self.limits.dead_man_age)

    def _silence(self, now: float) -> str:
        """What was not heard for too long."""
        for name, heard, most in (
            ("scan", self._scan, self.limits.scan_age),
            ("odometry", self._speed, self.limits.odometry_age),
        ):
            age = float("inf") if heard is None else now - heard[0]
            if age > most:
                return "no {} for {:.0f} ms".format(name, 1e3 * age)
        return ""

    def _begin(self) -> None:
        self._memory = self.driving.memory()
        self._phase, self._reason = DRIVING, ""

    def _wait(self, reason: str) -> None:
        self._phase, self._reason = WAITING, reason

    def _stop(self, reason: str) -> None:
        # The first reason counts; what follows from it does not.
        if self._phase != STOPPED:
            self._phase, self._reason = STOPPED, reason
            if self._record is not None:
                self._record.flush()

    def _told(self, speed: float = 0.0) -> Drive:
        return Drive(speed, self._angle, self._phase, self._reason)

    def _decided(self, now: float, late: float) -> Drive:
        """Sense, judge, decide; whatever is wrong stops the car."""
        trouble = self._silence(now) or self._sensed()
        speed = float("nan") if self._speed is None else self._speed[1]
        signals = {**self._signals, **self._memory.signals(speed)}
        self.verdicts = self.monitor(signals)
        violated = violated_safety(self.verdicts)
        if violated and not trouble:
            trouble = "{} is violated".format(", ".join(violated))
        trouble = trouble or self._acted()
        decision = self.clock() - now
        self.decisions.append(decision)
        if decision > self.limits.decision and not trouble:
            trouble = "the policy took {:.0f} ms".format(1e3 * decision)
        if trouble:
            self._stop(trouble)
        drive = self._drive()
        if self._record is not None:
            extra = {
                **drive._asdict(),
                "decision": decision,
                "lateness": late,
            }
            self._record.write(now, signals, self.verdicts, extra)
            if self._phase == STOPPED:
                self._record.flush()
        return drive

    def _drive(self) -> Drive:
        if self._phase != DRIVING:
            return self._told()
        asked = self.driving.asked(self._memory.commands[-1])
        self._angle = asked.steering_angle
        return self._told(asked.speed)

    def _sensed(self) -> str:
        """Remember the newest readings; says why they cannot be used."""
        if self._scan is None or self._speed is None:
            return "nothing was heard"
        scan, speed = self._scan[1], self._speed[1]
        refused = refusal(scan, self.driving.beams, self._mounting)
        if refused:
            return refused
        if not np.isfinite(speed):
            return "odometry says a speed of {}".format(speed)
        distances = resample(scan, self.driving.beams, self._mounting)
        unknown = np.isnan(distances)
        count = int(unknown.sum())
        if count > self.limits.unknown_beams * len(distances):
            return "{} of {} beams have no reading".format(count, len(distances))
        if count:
            places = np.arange(len(distances))
            known = ~unknown
            distances[unknown] = np.interp(places[unknown], places[known], distances[known])
        self._memory.sense(distances, speed)
        return ""

    def _acted(self) -> str:
        """Let the policy decide; says why that cannot be obeyed."""
        try:
            action = self._bundle(self._memory.observation())
        except BundleError as error:
            return "the policy fails: {}".format(error)
        return self._memory.obey(action, self.limits.speed)


class Pace(NamedTuple):
    """How well a loop kept its time, s."""

    ticks: int
    median: float
    """Lateness of a tick."""
    most: float
    """The largest one."""
    decision: float
    """Median of a decision."""


def pace(loop: ControlLoop) -> Pace:
    """How well a loop has kept its time so far."""
    late, decisions = list(loop.lateness), list(loop.decisions)
    return Pace(
        ticks=len(late),
        median=_median(late),
        most=max(late) if late else float("nan"),
        decision=_median(decisions),
    )


def run(
    loop: ControlLoop,
    publish: Callable[[Drive], None],
    *,
    sleep: Callable[[float], None] = time.sleep,
    going: Callable[[], bool] = lambda: True,
    check_every: float = 0.02,
) -> None:
    """Tick at the policy's rate, and look between two ticks whether the car must be stopped.

    Args:
        loop: The loop.
        publish: Takes every command; while the car stands too, so that silence means trouble.
        sleep: Waits some seconds of the loop's clock.
        going: Whether to go on.
        check_every: Longest time between two looks, s.
    """
    due = loop.clock()
    while going():
        publish(loop.tick(due))
        # What was missed is not made up for.
        due = max(due + loop.period, loop.clock())
        while going() and loop.clock() < due:
            sleep(min(check_every, max(0.0, due - loop.clock())))
            stop = loop.check()
            if stop is not None:
                publish(stop)


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if values else float("nan")
