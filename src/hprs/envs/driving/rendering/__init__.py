"""Pictures of the driving environments. Pillow is imported where one is asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hprs.envs.driving.simulation import Simulation
from hprs.errors import UsageError, did_you_mean

if TYPE_CHECKING:
    from hprs.envs.driving.rendering.drawing import Drawing

RENDER_MODES = ("rgb_array",)
"""What an environment draws itself; `gymnasium.make` makes `human` and `rgb_array_list` of it."""
CAMERAS = ("fixed", "follow")
"""The whole track, north up; or the surroundings of the car, its heading up."""


def make_drawing(simulation: Simulation, render_mode: Any, camera: Any) -> Drawing | None:
    """What draws the episodes of an environment; None where nothing is to be drawn.

    Raises:
        UsageError: There is no such mode or camera.
        MissingExtraError: Pillow is not installed.
    """
    _check("camera", camera, CAMERAS)
    if render_mode is None:
        return None
    _check("render_mode", render_mode, RENDER_MODES)
    from hprs.envs.driving.rendering.drawing import Drawing

    return Drawing(simulation, camera)


def _check(name: str, value: Any, known: tuple[str, ...]) -> None:
    if value not in known:
        allowed = " or ".join((*known, "None") if name == "render_mode" else known)
        raise UsageError(f"{name} is {allowed}, not {value!r}.{did_you_mean(str(value), known)}")
