"""What the policies of a report look like: a storyboard and a film of an episode of each."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hprs.cli.assessed_run import policies_of_runs
from hprs.experiments.recorded import Recorded
from hprs.experiments.report import Picture
from hprs.explanation.episode import record
from hprs.explanation.explanation import explain
from hprs.explanation.film import PAGE, Film
from hprs.explanation.video import write_video
from hprs.explanation.wording import summary
from hprs.training import files
from hprs.training.environment import make_configured
from hprs.training.evaluation import FINAL_SEEDS

if TYPE_CHECKING:
    from hprs.explanation.explanation import Explanation
    from hprs.wrappers.single import TaskWrapper

_FRAMES = 6
"""Of a storyboard."""
_WIDTH = 320
"""Of each, in pixels at most."""


def pictures_of(run: Recorded, label: str, folder: Path) -> list[Picture]:
    """A storyboard and a film of the last policy of a run, from a folder where they are kept.

    Args:
        run: The run.
        label: What the report calls its reward.
        folder: Where they are kept, by the policy's checksum.

    Raises:
        RunError: The run has no policy, or the folder cannot be written.
    """
    checksum = files.checksum(files.read(run.run.policy_file("last")))
    base = folder / f"{run.configuration.environment.rpartition('/')[2]}-{checksum[:16]}"
    board, film, text = (base.with_name(base.name + end) for end in (".png", ".webp", ".txt"))
    if not text.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        found, taken = _played(run)
        if taken.frames:
            with files.writing(board):
                files.replace(board, _storyboard(found, taken))
            write_video(found, taken, film)
        with files.writing(text):
            # Written last: where it is, the others are.
            files.replace(text, summary(found).encode())
    if not board.is_file():
        return []
    caption = f"{label}, seed {run.configuration.seed}: {text.read_text(encoding='utf-8')}"
    return [
        Picture(caption, "png", files.read(board), moves=False),
        Picture("The same episode, with the state of each requirement.", "webp", files.read(film),
                moves=True),
    ]  # fmt: skip


def _played(run: Recorded) -> tuple[Explanation, Film]:
    # Pygame draws into memory; no window is needed.
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")

    def make(**more: Any) -> TaskWrapper:
        return make_configured(run.configuration, **more)

    (policy,) = policies_of_runs([run.run], "last", make).values()
    played = record(make, policy, FINAL_SEEDS, PAGE)
    task = run.configuration.task
    return explain(task, played.trace, title="", rate=played.rate), played.film


def _storyboard(found: Explanation, film: Film) -> bytes:
    """Pictures of the episode in a row, each with its moment below."""
    from PIL import Image, ImageDraw, ImageFont

    count = min(_FRAMES, len(film.frames))
    chosen = np.linspace(0, len(film.frames) - 1, count).round().astype(int)
    images: list[Image.Image] = []
    for index in chosen:
        image = Image.open(io.BytesIO(film.frames[index].data)).convert("RGB")
        image.thumbnail((_WIDTH, _WIDTH))
        images.append(image)
    width, height = images[0].size
    board = Image.new("RGB", (count * (width + 4) - 4, height + 22), "white")
    pen, font = ImageDraw.Draw(board), ImageFont.load_default(13)
    for place, (index, image) in enumerate(zip(chosen, images, strict=True)):
        left = place * (width + 4)
        board.paste(image, (left, 0))
        moment = found.moment(film.frames[index].step)
        pen.text((left + 4, height + 4), moment, fill="#333", font=font)
    data = io.BytesIO()
    board.quantize(128).save(data, format="png", optimize=True)
    return data.getvalue()
