"""Keeps the pictures of an episode, small and few enough for one page."""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Stock:
    """How large and how many the pictures of a film may be."""

    size: tuple[int, int]
    """Width and height of a picture at most, in pixels."""
    most: int
    """Pictures at most."""
    budget: int
    """Bytes of all pictures at most."""
    format: str
    """Of the pictures, as Pillow calls it."""
    quality: int
    """Of the pictures, up to 100."""


PAGE = Stock((480, 360), most=600, budget=6_000_000, format="webp", quality=80)
"""For a page, which writes four characters for three bytes."""
VIDEO = Stock((960, 720), most=5_000, budget=500_000_000, format="jpeg", quality=95)
"""For a video, whose pictures are encoded again: quickly, and once only."""


@dataclass(frozen=True)
class Frame:
    """One picture."""

    step: int
    data: bytes


@dataclass
class Film:
    """Pictures of an episode, from its first state on.

    Whenever they become too many, every second one is left out, of those to come as well.
    """

    stock: Stock = PAGE
    every: int = 1
    """Steps from one picture to the next."""
    frames: list[Frame] = field(default_factory=list[Frame])
    trouble: str = ""
    """Why there are no pictures, or none from some step on."""

    def wants(self, step: int) -> bool:
        """Whether a picture of this step is kept."""
        return not self.trouble and step % self.every == 0

    @property
    def _is_full(self) -> bool:
        size = sum(len(frame.data) for frame in self.frames)
        return len(self.frames) > self.stock.most or size > self.stock.budget

    def add(self, step: int, picture: Any) -> None:
        """Keep a picture, an array of height, width and three colours."""
        self.frames.append(Frame(step, encoded(picture, self.stock)))
        while self._is_full:
            self.every *= 2
            newest = self.frames[-1]
            self.frames = [f for f in self.frames if f.step % self.every == 0 or f is newest]


def encoded(picture: Any, stock: Stock = PAGE) -> bytes:
    """A picture as a small file."""
    from PIL import Image

    image = Image.fromarray(picture).convert("RGB")
    image.thumbnail(stock.size, Image.Resampling.LANCZOS)
    data = io.BytesIO()
    image.save(data, format=stock.format, quality=stock.quality)
    return data.getvalue()
