"""Pictures of an episode: small, and few enough."""

import io
from dataclasses import replace

import numpy as np
from PIL import Image

from hprs.explanation.film import PAGE, Film, encoded

GREY = np.full((40, 60, 3), 128, np.uint8)


def played(steps, **stock):
    found = Film(replace(PAGE, **stock))
    for step in range(steps + 1):
        if found.wants(step) or step == steps:
            found.add(step, GREY)
    return found


def test_a_short_film_has_every_step():
    assert [frame.step for frame in played(20).frames] == list(range(21))


def test_a_long_film_has_every_second_fourth_and_so_on_and_the_last():
    found = played(35, most=10)
    assert found.every == 4
    assert [frame.step for frame in found.frames] == [0, 4, 8, 12, 16, 20, 24, 28, 32, 35]


def test_a_film_keeps_within_its_bytes():
    budget = 12 * len(encoded(GREY))
    found = played(100, budget=budget)
    assert sum(len(frame.data) for frame in found.frames) <= budget
    assert found.frames[-1].step == 100


def test_pictures_are_scaled_down_and_never_up():
    sizes = [
        Image.open(io.BytesIO(encoded(np.zeros((height, width, 3), np.uint8)))).size
        for width, height in ((960, 600), (60, 40))
    ]
    assert sizes == [(480, 300), (60, 40)]
