"""A picture drawn in metres: several times too large, then reduced, so that edges are smooth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hprs.errors import MissingExtraError

try:
    from PIL import Image, ImageDraw, ImageFont
except ModuleNotFoundError as error:
    if error.name != "PIL":
        raise
    raise MissingExtraError("Pillow", "report") from None

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

OVERSIZE = 3
"""Times that a picture is drawn too large."""

Points: TypeAlias = NDArray[np.float64]
"""Places, (..., 2), m."""
Colour: TypeAlias = tuple[int, int, int] | tuple[int, int, int, int]
"""Red, green, blue and, maybe, opacity: 0 to 255."""
Shape: TypeAlias = tuple[Points, Colour]
"""The inside of a closed line, (P, 2) m, and what it is filled with."""


@dataclass(frozen=True)
class View:
    """Where the metres of the world are among the pixels of a picture."""

    looks_at: tuple[float, float]
    """A place in the world, m."""
    at: tuple[float, float]
    """The pixel that shows it, from the left and from the top."""
    scale: float
    """Pixels in a metre."""
    up: float = np.pi / 2
    """The direction that points up in the picture, rad; north is pi/2."""

    def to_pixels(self, points: ArrayLike) -> Points:
        """Pixels of places, (..., 2)."""
        cosine, sine = self.scale * np.cos(self.up), self.scale * np.sin(self.up)
        turn = np.array([[sine, -cosine], [-cosine, -sine]])
        return (np.asarray(points, float) - self.looks_at) @ turn + self.at


class Canvas:
    """A picture that is being drawn; colours with an opacity are mixed with what is below.

    Args:
        size: Width and height of the finished picture in pixels.
        colour: Of the empty picture.
    """

    def __init__(self, size: tuple[int, int], colour: Colour) -> None:
        self._open(Image.new("RGB", (size[0] * OVERSIZE, size[1] * OVERSIZE), colour))

    def _open(self, image: Image.Image) -> None:
        self._image = image
        self._opaque, self._mixing = ImageDraw.Draw(image), ImageDraw.Draw(image, "RGBA")

    def _pen(self, colour: Colour) -> ImageDraw.ImageDraw:
        # The pen that mixes takes ten times as long for a large area.
        return self._opaque if len(colour) == 3 else self._mixing

    def copy(self) -> Canvas:
        """The same picture, to be drawn on alone."""
        twin = Canvas.__new__(Canvas)
        twin._open(self._image.copy())
        return twin

    def finished(self) -> Image.Image:
        """The picture in its own size."""
        return self._image.reduce(OVERSIZE)

    def fill(self, view: View, shapes: Sequence[Shape]) -> None:
        """Fill shapes, the first one below the others."""
        if not shapes:
            return
        sizes = [len(points) for points, _ in shapes]
        pixels = view.to_pixels(np.concatenate([points for points, _ in shapes])) * OVERSIZE
        firsts = np.cumsum([0, *sizes[:-1]])
        seen = (np.maximum.reduceat(pixels, firsts) > 0).all(axis=1)
        seen &= (np.minimum.reduceat(pixels, firsts) < self._image.size).all(axis=1)
        for index in np.flatnonzero(seen).tolist():
            part = pixels[firsts[index] : firsts[index] + sizes[index]]
            # A list of numbers is what Pillow reads fastest.
            colour = shapes[index][1]
            self._pen(colour).polygon(part.ravel().tolist(), fill=colour)

    def line(
        self, view: View, points: ArrayLike, colour: Colour, *, width: float, least: float = 1.0
    ) -> None:
        """A line through places (P, 2), `width` m wide and at least so many pixels."""
        pixels = round(max(width * view.scale, least) * OVERSIZE)
        corners = (view.to_pixels(points) * OVERSIZE).ravel().tolist()
        self._pen(colour).line(corners, fill=colour, width=pixels)

    def disc(
        self, view: View, place: ArrayLike, colour: Colour, *, radius: float, least: float = 1.0
    ) -> None:
        """A filled circle around a place (2,), with a radius in m, at least so many pixels."""
        self._pen(colour).ellipse(
            self._circle(view, place, max(radius * view.scale, least)), fill=colour
        )

    def ring(self, view: View, place: ArrayLike, colour: Colour, *, radius: float) -> None:
        """A circle around a place (2,), with a radius in m."""
        circle = self._circle(view, place, radius * view.scale)
        self._pen(colour).ellipse(circle, outline=colour, width=3 * OVERSIZE)

    def box(
        self, corners: tuple[float, float, float, float], colour: Colour, *, radius: float = 0.0
    ) -> None:
        """A filled rectangle with round corners, from left and top to right and bottom, pixels."""
        left, top, right, bottom = (round(OVERSIZE * corner) for corner in corners)
        if left < right and top < bottom:
            area = (left, top, right - 1, bottom - 1)
            self._pen(colour).rounded_rectangle(area, radius=radius * OVERSIZE, fill=colour)

    @staticmethod
    def _circle(view: View, place: ArrayLike, pixels: float) -> tuple[float, float, float, float]:
        x, y = (view.to_pixels(place) * OVERSIZE).tolist()
        r = pixels * OVERSIZE
        return x - r, y - r, x + r, y + r


@lru_cache(maxsize=8)
def font(size: int) -> FreeTypeFont | ImageFont.ImageFont:
    """Pillow's own font."""
    return ImageFont.load_default(size)
