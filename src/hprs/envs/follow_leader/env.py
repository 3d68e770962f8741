"""Follow the leader: the car behind another one, which drives itself."""

from __future__ import annotations

from typing import Any

from hprs.envs.driving.options import Options, lists_options, simulate_single
from hprs.envs.driving.single import DrivingEnv
from hprs.envs.driving.vector import DrivingVectorEnv
from hprs.envs.registration import BENCHMARKS

DEFAULTS = Options(
    tracks="gm-c", horizon=BENCHMARKS["hprs/FollowLeader-v0"].horizon, cars=2, stacked=3
)
"""The paper's table: 3,000 simulation steps, 10 of them a control step."""


@lists_options(DEFAULTS)
class FollowLeader(DrivingEnv):
    """A car that has to drive a lap behind another one.

    Args:
        render_mode: `rgb_array` or None; `gymnasium.make` knows `rgb_array_list` and `human` too.
        camera: Of pictures: `fixed`, the whole track, or `follow`, around the car.
        tracks: Names of built-in tracks, `random:SEED`, `random:FIRST-LAST`, map files, map files
            with a centre line (`map.yaml+line.csv`), or `hprs.carsim.track.Track`s; each episode
            draws one.
        reverse: Drive them the other way round.
        randomisation: Vary both cars, their sensors and actuators; or a name of ranges: `all`,
            `released`, `released-gm`, `nominal`; or quantities with a value or [low, high].
        start: `random`, anywhere on the track, or `grid`, at the start line.
        beams: Of the lidar that is observed; the leader's has 64.
        reach: Of that lidar, m.
        stacked: Scans and speeds in an observation.
        gap_threshold: Distance in m beyond which the leader takes a beam for a gap.
        dropped_scans: Probability that a scan is lost, and the one before stays.
        speed_scale: Factor of the measured speed.
        speed_offset: Added to the measured speed, m/s.

    Raises:
        UsageError: There is no such option, or it has no such value.
        TrackError: A map file cannot be read or driven.
    """

    def __init__(
        self, render_mode: str | None = None, *, camera: str = "fixed", **options: Any
    ) -> None:
        super().__init__(simulate_single(DEFAULTS, **options), render_mode, camera)


class FollowLeaderVector(DrivingVectorEnv):
    """Many of them, stepped by one compiled call; options are those of `FollowLeader`."""

    defaults = DEFAULTS
