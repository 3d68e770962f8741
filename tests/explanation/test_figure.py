"""The picture of an explanation."""

import io

import numpy as np
import pytest
from PIL import Image

from hprs.explanation.explanation import explain
from hprs.explanation.figure import draw
from hprs.explanation.film import Film
from tests.explanation.episodes import TASK, short_film, trace


@pytest.mark.parametrize(("steps", "film"), [(30, short_film(30)), (1, Film()), (5_000, Film())])
def test_the_picture_is_large_enough_and_shows_something(steps, film):
    found = explain(TASK, trace(steps), title="An episode $x_1$ <b>", rate=50.0)
    image = Image.open(io.BytesIO(draw(found, film)))
    assert image.format == "PNG"
    width, height = image.size
    assert width == 1100
    assert 500 <= height <= 1500
    pixels = np.asarray(image.convert("RGB"))
    assert 0.5 < (pixels == 255).all(axis=-1).mean() < 0.95
    # The contributions of the first requirement, which holds, fill a part of the picture.
    blue = np.abs(pixels.astype(int) - (0x26, 0x87, 0xBE)).max(axis=-1) < 12
    assert blue.mean() > 0.02
