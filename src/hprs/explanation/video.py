"""Makes a video of an episode: its pictures, and beside them the state of every requirement.

GIF and WebP are written by Pillow; anything else, such as MP4, by the program ffmpeg.
"""

from __future__ import annotations

import contextlib
import io
import itertools
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, cast

import numpy as np

from hprs.errors import UsageError
from hprs.explanation.explanation import Explanation, Part
from hprs.explanation.film import Film
from hprs.explanation.outline import axis
from hprs.explanation.palette import colours, failing
from hprs.explanation.wording import number

if TYPE_CHECKING:
    from PIL import Image
    from PIL.ImageDraw import ImageDraw

STILL = (".gif", ".webp")
"""What Pillow writes."""
SUFFIXES = (*STILL, ".mp4", ".webm", ".mkv", ".mov")
RATE = 10.0
"""Steps a second of what does not state its own."""
FASTEST = {".gif": 25.0, ".webp": 30.0}
"""Pictures a second, at most; of a faster episode only every second, third ... step is shown."""
SAMPLES = 6
"""Pictures among which the colours of a GIF are found."""
LAST = 1.5
"""How long the end is shown, in seconds."""

_PANEL, _EDGE = 300, 14
"""Width of the panel, and the space around what is in it, in pixels."""
_HEAD, _ROW = 62, 33
"""Heights of the panel's head and of a requirement in it, in pixels."""
_PAPER, _INK, _FAINT, _GROOVE = (255, 255, 255), (38, 43, 51), (112, 118, 126), (226, 229, 233)


@dataclass(frozen=True, eq=False)
class _Row:
    """A requirement in the panel."""

    part: Part
    shade: str
    """Its colour while it holds."""
    heights: np.ndarray
    """Where its margin is drawn in each state: 0.5 is a margin of 0."""


def write_video(
    explanation: Explanation,
    film: Film,
    path: Path,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write a video, in the episode's true time.

    Args:
        explanation: What happened.
        film: Its pictures; without any the panel stands alone.
        path: Where it goes; its suffix says in which format.
        progress: Told how many pictures are drawn, and of how many.

    Raises:
        UsageError: ffmpeg is needed and not there, or fails.
    """
    check_suffix(path)
    steps, rate = _schedule(explanation, film, path.suffix)
    pictures = _pictures(explanation, film, steps, progress)
    if path.suffix in STILL:
        if path.suffix == ".gif":
            some = np.linspace(0, len(steps) - 1, SAMPLES).round().astype(int)
            samples = list(_pictures(explanation, film, [steps[index] for index in some], None))
            pictures = _in_few_colours(pictures, samples)
        _write_still(pictures, path, count=len(steps), rate=rate)
    else:
        _write_by_ffmpeg(pictures, path, rate=rate)


def check_suffix(path: Path) -> None:
    """See that a video of this name can be written, before an episode is played for it.

    Raises:
        UsageError: It cannot.
    """
    if path.suffix not in SUFFIXES:
        raise UsageError(f"a video's name ends in {', '.join(SUFFIXES)}; '{path}' does not.")
    if path.suffix not in STILL and shutil.which("ffmpeg") is None:
        raise UsageError(
            f"'{path}' needs the program ffmpeg, which is not installed. "
            f"Install it, or take {path.with_suffix('.gif')}."
        )


def _schedule(explanation: Explanation, film: Film, suffix: str) -> tuple[list[int], float]:
    """The steps that are shown, and how many of them a second."""
    rate = explanation.rate or RATE
    every = max(film.every, int(np.ceil(rate / FASTEST.get(suffix, 60.0) - 1e-9)))
    steps = list(range(0, explanation.steps + 1, every))
    if steps[-1] != explanation.steps:
        steps.append(explanation.steps)
    return steps, rate / every


def _pictures(
    explanation: Explanation,
    film: Film,
    steps: Sequence[int],
    progress: Callable[[int, int], None] | None,
) -> Iterator[Image.Image]:
    shades = colours(explanation.parts)
    rows = [
        _Row(part, shade, np.asarray(axis(part).place(part.margins)))
        for part, shade in zip(explanation.parts, shades, strict=True)
    ]
    taken = np.array([frame.step for frame in film.frames], dtype=int)
    for index, step in enumerate(steps):
        scene = None
        if len(taken):
            # The newest picture up to this step; pictures may be rarer than steps.
            scene = film.frames[int(np.searchsorted(taken, step, side="right")) - 1].data
        yield _picture(explanation, rows, step, scene)
        if progress is not None:
            progress(index + 1, len(steps))


def _picture(
    explanation: Explanation, rows: Sequence[_Row], step: int, scene: bytes | None
) -> Image.Image:
    from PIL import Image, ImageDraw

    seen = None if scene is None else Image.open(io.BytesIO(scene)).convert("RGB")
    wide, high = (0, 0) if seen is None else seen.size
    # Encoders of videos want even sizes.
    size = _even(wide + _PANEL), _even(max(high, _HEAD + len(rows) * _ROW + _EDGE))
    picture = Image.new("RGB", size, _PAPER)
    if seen is not None:
        picture.paste(seen, (0, (size[1] - high) // 2))
    pen = ImageDraw.Draw(picture)
    left, right = wide + _EDGE, wide + _PANEL - _EDGE
    _draw_head(pen, explanation, step, (left, right))
    for place, row in enumerate(rows):
        _draw_row(pen, row, step, (left, right), _HEAD + place * _ROW)
    return picture


def _draw_head(pen: ImageDraw, explanation: Explanation, step: int, ends: tuple[int, int]) -> None:
    left, right = ends
    top = 10
    pen.text((left, top), explanation.moment(step), fill=_INK, font=_font(14))
    potential = float(explanation.potential[step])
    pen.text((right, top), f"potential {potential:.2f}", fill=_INK, font=_font(14), anchor="ra")
    share = potential / max(len(explanation.parts), 1)
    pen.rectangle((left, top + 26, right, top + 32), fill=_GROOVE)
    pen.rectangle((left, top + 26, left + round(share * (right - left)), top + 32), fill=_FAINT)


def _draw_row(pen: ImageDraw, row: _Row, step: int, ends: tuple[int, int], top: int) -> None:
    left, right = ends
    holds = bool(row.part.satisfied[step])
    colour = row.shade if holds else failing(row.part)
    _draw_mark(pen, (left, top + 3), colour, holds=holds)
    ink = _INK if holds else colour
    pen.text((left + 18, top), row.part.name, fill=ink, font=_font(13))
    # Pillow's font has no minus sign of print.
    margin = number(float(row.part.margins[step])).replace("\N{MINUS SIGN}", "-")
    pen.text((right, top), margin, fill=ink, font=_font(13), anchor="ra")
    base = top + 20
    middle = (left + right) / 2
    end = left + float(row.heights[step]) * (right - left)
    pen.rectangle((left, base, right, base + 4), fill=_GROOVE)
    pen.rectangle((min(middle, end), base, max(middle, end), base + 4), fill=colour)
    pen.line((middle, base - 2, middle, base + 6), fill=_INK)
    broken = row.part.first_violation
    if broken is not None and broken <= step:
        # It stays to be seen that it did not always hold.
        pen.ellipse((right + 3, base - 1, right + 9, base + 5), fill=failing(row.part))


def _draw_mark(pen: ImageDraw, place: tuple[int, int], colour: str, *, holds: bool) -> None:
    """A tick or a cross, since colour alone tells nothing."""
    x, y = place
    if holds:
        pen.line((x, y + 5, x + 4, y + 9, x + 11, y), fill=colour, width=3)
    else:
        pen.line((x + 1, y, x + 10, y + 9), fill=colour, width=3)
        pen.line((x + 1, y + 9, x + 10, y), fill=colour, width=3)


def _font(size: int) -> Any:
    from PIL import ImageFont

    return ImageFont.load_default(size)


def _even(length: int) -> int:
    return length + length % 2


def _in_few_colours(
    pictures: Iterator[Image.Image], samples: Sequence[Image.Image]
) -> Iterator[Image.Image]:
    """The pictures in one palette for all of them, which is found in some."""
    from PIL import Image

    width, height = samples[0].size
    board = Image.new("RGB", (width, height * len(samples)))
    for place, sample in enumerate(samples):
        board.paste(sample, (0, place * height))
    # Other methods give no colour to what is small, as a car is.
    palette = board.quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=1)
    return (picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures)


def _write_still(pictures: Iterator[Image.Image], path: Path, *, count: int, rate: float) -> None:
    from hprs.training import files

    durations = [round(1000 / rate)] * (count - 1) + [round(1000 * LAST)]
    data = io.BytesIO()
    next(pictures).save(
        data,
        format=path.suffix[1:],
        save_all=True,
        append_images=pictures,
        duration=durations,
        loop=0,
    )
    with files.writing(path):
        files.replace(path, data.getvalue())


def _write_by_ffmpeg(pictures: Iterator[Image.Image], path: Path, *, rate: float) -> None:
    from hprs.training import files

    first = next(pictures)
    width, height = first.size
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / f"video{path.suffix}"
        command = (
            "ffmpeg", "-v", "error", "-f", "rawvideo", "-pix_fmt", "rgb24",
            "-s", f"{width}x{height}", "-r", f"{rate:g}", "-i", "-",
            "-vf", f"tpad=stop_mode=clone:stop_duration={LAST:g}", "-pix_fmt", "yuv420p", str(made),
        )  # fmt: skip
        complaints = Path(folder) / "complaints"
        with complaints.open("wb") as stderr:
            process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=stderr)
            # It may end early; what it complains of is said below.
            with contextlib.suppress(BrokenPipeError), process:
                for picture in itertools.chain([first], pictures):
                    cast("IO[bytes]", process.stdin).write(picture.tobytes())
        if process.returncode:
            raise UsageError(f"ffmpeg cannot write {path}: {complaints.read_text().strip()}")
        with files.writing(path):
            files.replace(path, made.read_bytes())
