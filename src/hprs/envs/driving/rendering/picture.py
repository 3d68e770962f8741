"""Pictures of an episode from above, around the whole track or around the car."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hprs.carsim.lidar import LIDAR, Lidar, beam_angles
from hprs.envs.driving.rendering.canvas import Canvas, Colour, Points, Shape, View
from hprs.envs.driving.rendering.car import car_shapes
from hprs.envs.driving.rendering.ground import GROUND, WALL_EDGE, Ground, scenery, silhouette
from hprs.envs.driving.rendering.panel import HEIGHT as PANEL
from hprs.envs.driving.rendering.panel import draw_bars, write_words
from hprs.envs.driving.rendering.scene import Scene

SIZE = (720, 480)
"""Width and height of a picture in pixels; the encoders of films want even numbers."""
MARGIN = 26
"""Free pixels around the whole track."""
NEAR_SCALE = 90.0
"""Pixels in a metre around the car."""
NEAR_PLACE = 0.68
"""Height at which the car stands there, from the top."""
# Orange and sky blue differ for every eye (Okabe and Ito).
CAR: Colour = (245, 160, 0)
LEADER: Colour = (86, 180, 233)
COLOURS: tuple[tuple[Colour, Colour], ...] = ((CAR, (176, 106, 0)), (LEADER, (26, 110, 165)))
"""Of the body and of the wings of each car."""
LIDAR_POINT: Colour = (190, 255, 226)
LIDAR_AREA: Colour = (190, 255, 226, 26)
LIDAR_RAY: Colour = (190, 255, 226, 30)
CONTACT: Colour = (213, 94, 0)
_STANDING = 1e-3
_MAP = (SIZE[0] - 144.0, 12.0, SIZE[0] - 12.0, 96.0)
"""Where the small map is beside the car: left, top, right, bottom."""
_MAP_BACK: Colour = (250, 250, 247)
_MAP_TRACK: Colour = (172, 178, 184)


class Painter:
    """Draws scenes on one track.

    Args:
        ground: The track.
        camera: `fixed` or `follow`.
    """

    def __init__(self, ground: Ground, camera: str) -> None:
        self.ground = ground
        self._whole = _around(ground, (0, 0, SIZE[0], SIZE[1] - PANEL), MARGIN)
        self._still: Canvas | None = None
        if camera == "fixed":
            self._still = Canvas(SIZE, GROUND)
            self._still.fill(self._whole, scenery(ground, self._whole.scale))
        else:
            self._scenery = scenery(ground, NEAR_SCALE)
            self._map = _around(ground, _MAP, 9)
            self._map_shapes = silhouette(ground, _MAP_TRACK, _MAP_BACK)

    def paint(self, scene: Scene) -> NDArray[np.uint8]:
        """The picture of a scene, (height, width, 3)."""
        if self._still is not None:
            canvas, view = self._still.copy(), self._whole
        else:
            canvas, view = Canvas(SIZE, GROUND), _near(scene)
            canvas.fill(view, self._scenery)
        _draw_scene(canvas, view, scene)
        if self._still is None:
            self._draw_map(canvas, scene)
        draw_bars(canvas, SIZE, scene)
        image = canvas.finished()
        write_words(image, scene)
        return np.array(image)

    def _draw_map(self, canvas: Canvas, scene: Scene) -> None:
        canvas.box(_MAP, _MAP_BACK, radius=6)
        canvas.fill(self._map, self._map_shapes)
        for pose, (colour, _) in reversed(list(zip(scene.poses, COLOURS, strict=False))):
            canvas.disc(self._map, pose[:2], WALL_EDGE, radius=0, least=4.5)
            canvas.disc(self._map, pose[:2], colour, radius=0, least=3.5)


def _around(ground: Ground, box: tuple[float, float, float, float], margin: float) -> View:
    """The whole track, north up, in a part of the picture: left, top, right, bottom."""
    low, high = ground.corners
    left, top, right, bottom = box
    room = np.array([right - left, bottom - top]) - 2 * margin
    return View(
        looks_at=tuple((low + high) / 2),
        at=((left + right) / 2, (top + bottom) / 2),
        scale=float(np.min(room / (high - low))),
    )


def _near(scene: Scene) -> View:
    """The surroundings of car 0, its heading up."""
    x, y, yaw = scene.poses[0].tolist()
    at = (SIZE[0] / 2, NEAR_PLACE * (SIZE[1] - PANEL))
    return View(looks_at=(x, y), at=at, scale=NEAR_SCALE, up=yaw)


def _draw_scene(canvas: Canvas, view: View, scene: Scene) -> None:
    number = len(scene.poses)
    for index in range(number):
        canvas.fill(view, _trail(view, scene.trail[:, index], COLOURS[index][0]))
    _draw_lidar(canvas, view, scene)
    for index in reversed(range(number)):
        colour, dark = COLOURS[index]
        wheels = float(scene.wheels[index])
        canvas.fill(view, car_shapes(view, scene.poses[index], wheels, colour=colour, dark=dark))
    if scene.hit_wall or scene.hit_car:
        canvas.ring(view, scene.poses[0, :2], CONTACT, radius=max(0.5, 16 / view.scale))


def _trail(view: View, trail: Points, colour: Colour) -> list[Shape]:
    """A ribbon along the places of a car that fades with their age."""
    trail = trail[np.r_[True, np.hypot(*np.diff(trail, axis=0).T) > _STANDING]]
    if len(trail) < 2:
        return []
    along = np.gradient(trail, axis=0)
    half = max(0.055, 2 / view.scale) / 2
    aside = half * np.stack([-along[:, 1], along[:, 0]], axis=1) / np.hypot(*along.T)[:, None]
    left, right = trail + aside, trail - aside
    return [
        (
            np.array([left[i], left[i + 1], right[i + 1], right[i]]),
            (*colour[:3], round(200 * ((i + 1) / len(trail)) ** 1.5)),
        )
        for i in range(len(trail) - 1)
    ]


def _draw_lidar(canvas: Canvas, view: View, scene: Scene) -> None:
    x, y, yaw = scene.poses[0].tolist()
    eye = np.array([x, y]) + LIDAR.ahead * np.array([np.cos(yaw), np.sin(yaw)])
    angles = yaw + beam_angles(Lidar(beams=len(scene.scan)))
    ends = eye + scene.scan[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    canvas.fill(view, [(np.concatenate([[eye], ends]), LIDAR_AREA)])
    for end in ends:
        canvas.line(view, [eye, end], LIDAR_RAY, width=0.0, least=0.7)
    # What is beyond the reach is no point of anything.
    for end in ends[scene.scan < scene.reach]:
        canvas.disc(view, end, LIDAR_POINT, radius=0.022, least=1.5)
