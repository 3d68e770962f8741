"""Safe driving: the car alone on a track that each episode draws."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gymnasium.vector import AutoresetMode

from hprs.envs.driving.options import Options, simulate
from hprs.envs.driving.single import DrivingEnv
from hprs.envs.driving.vector import DrivingVectorEnv

DEFAULTS = Options(tracks=("gm", "trt"), horizon=250)
"""The paper's table: 2,500 simulation steps, 10 of them a control step."""


class SafeDriving(DrivingEnv):
    """A car that has to drive a lap.

    Args:
        render_mode: None.
        tracks: Names of built-in tracks, `random:SEED`, or map files; each episode draws one.
        reverse: Drive them the other way round.
        randomisation: Vary car, sensors and actuators; or a name of ranges: `all`, `released`,
            `released-gm`, `nominal`.
        start: `random`, anywhere on the track, or `grid`, at the start line.
        beams: Of the lidar.
        stacked: Scans and speeds in an observation.

    Raises:
        UsageError: An option has no such value.
        TrackError: A map file cannot be read or driven.
    """

    def __init__(
        self,
        render_mode: str | None = None,
        *,
        tracks: str | Sequence[str] = DEFAULTS.tracks,
        reverse: bool = DEFAULTS.reverse,
        randomisation: bool | str = DEFAULTS.randomisation,
        start: str = DEFAULTS.start,
        beams: int = DEFAULTS.beams,
        stacked: int = DEFAULTS.stacked,
    ) -> None:
        simulation = simulate(
            DEFAULTS,
            tracks=tracks,
            reverse=reverse,
            randomisation=randomisation,
            start=start,
            beams=beams,
            stacked=stacked,
        )
        super().__init__(simulation, render_mode)


class SafeDrivingVector(DrivingVectorEnv):
    """Many of them, stepped by one compiled call.

    Args:
        num_envs: How many cars learn.
        max_episode_steps: Control steps after which an episode is truncated.
        autoreset_mode: When a row that has ended is reset.
        **options: Those of `SafeDriving`.

    Raises:
        UsageError: There is no such option, or it has no such value.
        TrackError: A map file cannot be read or driven.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_episode_steps: int = DEFAULTS.horizon,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        **options: Any,
    ) -> None:
        simulation = simulate(DEFAULTS, horizon=max_episode_steps, **options)
        super().__init__(simulation, num_envs, autoreset_mode)
