"""The strip below a picture: speed, steering, lap, distance to the leader, contacts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PIL import ImageDraw

from hprs.envs.driving.rendering.canvas import Canvas, Colour, font
from hprs.envs.driving.rendering.scene import Scene
from hprs.envs.driving.simulation import SPEED_SCALE

if TYPE_CHECKING:
    from PIL import Image

HEIGHT = 54
"""Of the strip in pixels."""
_BACK: Colour = (250, 250, 247)
_GROOVE: Colour = (222, 225, 220)
_TEXT: Colour = (38, 43, 51)
_FAINT: Colour = (122, 128, 136)
_FILL: Colour = (84, 91, 102)
_GOOD: Colour = (0, 128, 98)
_BAD: Colour = (205, 74, 0)
_LEFT = 20
_COLUMNS = ((20, 104), (150, 146), (322, 88), (436, 104))
"""Left end and width of what stands side by side, pixels."""
_BAR_TOP, _BAR_HEIGHT = 37, 5


def draw_bars(canvas: Canvas, size: tuple[int, int], scene: Scene) -> None:
    """Everything of the strip but its words."""
    width, height = size
    top = height - HEIGHT
    canvas.box((0, top, width, height), _BACK)
    canvas.box((0, top, width, top + 1), _GROOVE)
    parts = [
        (0.0, scene.speed / SPEED_SCALE),
        (0.5, 0.5 - scene.steering / 2),
        (0.0, scene.progress),
    ]
    for column, (start, end) in enumerate(parts):
        (x, wide), y = _COLUMNS[column], top + _BAR_TOP
        low, high = sorted((start, min(max(end, 0.0), 1.0)))
        radius = _BAR_HEIGHT / 2
        canvas.box((x, y, x + wide, y + _BAR_HEIGHT), _GROOVE, radius=radius)
        canvas.box((x + low * wide, y, x + high * wide, y + _BAR_HEIGHT), _FILL, radius=radius)
        if start:
            middle = x + start * wide
            canvas.box((middle - 1, y - 2, middle + 1, y + _BAR_HEIGHT + 2), _TEXT)
    x, y = width - _LEFT - 12, top + HEIGHT / 2
    touched = scene.hit_wall or scene.hit_car
    canvas.box((x, y - 6, x + 12, y + 6), _BAD if touched else _GOOD, radius=6)


def write_words(image: Image.Image, scene: Scene) -> None:
    """The words of the strip, on the picture in its own size."""
    pen = ImageDraw.Draw(image)
    top = image.height - HEIGHT
    words = [
        ("speed", f"{scene.speed:.1f} m/s"),
        ("steering", _steering(scene.steering)),
        ("lap", f"{100 * scene.progress:.0f} %"),
    ]
    if scene.lead is not None:
        words.append(("leader", f"{scene.lead:.1f} m"))
    for column, (name, value) in enumerate(words):
        x, wide = _COLUMNS[column]
        pen.text((x, top + 28), name, fill=_FAINT, font=font(13), anchor="ls")
        pen.text((x + wide, top + 28), value, fill=_TEXT, font=font(17), anchor="rs")
    touched = scene.hit_wall or scene.hit_car
    state = "wall touched" if scene.hit_wall else "leader touched" if touched else "no contact"
    place = (image.width - _LEFT - 20, top + HEIGHT / 2 + 5)
    pen.text(place, state, fill=_BAD if touched else _FAINT, font=font(14), anchor="rs")


def _steering(command: float) -> str:
    percent = round(100 * abs(command))
    if percent == 0:
        return "0 %"
    return f"{percent} % {'left' if command > 0 else 'right'}"
