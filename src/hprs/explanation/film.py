"""Keeps the pictures of an episode, small and few enough for one page."""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from typing import Any

FORMAT = "webp"
SIZE = (480, 360)
"""Width and height of a picture at most, in pixels."""
MOST = 600
"""Pictures at most."""
BUDGET = 6_000_000
"""Bytes of all pictures at most; a page writes four characters for three of them."""


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

    every: int = 1
    """Steps from one picture to the next."""
    frames: list[Frame] = field(default_factory=list[Frame])
    trouble: str = ""
    """Why there are no pictures, or none from some step on."""

    def wants(self, step: int) -> bool:
        """Whether a picture of this step is kept."""
        return not self.trouble and step % self.every == 0

    def add(self, step: int, picture: Any) -> None:
        """Keep a picture, an array of height, width and three colours."""
        self.frames.append(Frame(step, encoded(picture)))
        while len(self.frames) > MOST or sum(len(frame.data) for frame in self.frames) > BUDGET:
            self.every *= 2
            newest = self.frames[-1]
            self.frames = [f for f in self.frames if f.step % self.every == 0 or f is newest]


def encoded(picture: Any) -> bytes:
    """A picture as a small file."""
    from PIL import Image

    image = Image.fromarray(picture).convert("RGB")
    image.thumbnail(SIZE, Image.Resampling.LANCZOS)
    data = io.BytesIO()
    image.save(data, format=FORMAT, quality=80)
    return data.getvalue()
