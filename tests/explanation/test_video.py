"""Videos: which moments they show, for how long, and what is drawn."""

import io
import subprocess

import numpy as np
import pytest
from PIL import Image, ImageColor

from hprs.errors import UsageError
from hprs.explanation import video
from hprs.explanation.explanation import explain
from hprs.explanation.film import Film
from hprs.explanation.palette import VIOLATED
from hprs.explanation.video import LAST, write_video
from tests.explanation.episodes import TASK, short_film, trace
from tests.explanation.ffmpeg import require_ffmpeg

STEPS = 20


def written(path, *, rate=10.0, steps=STEPS, film=None):
    found = explain(TASK, trace(steps), title="lap", rate=rate)
    write_video(found, short_film(steps) if film is None else film, path)
    return Image.open(io.BytesIO(path.read_bytes()))


def durations(picture):
    found = []
    for index in range(picture.n_frames):
        picture.seek(index)
        picture.load()
        found.append(picture.info["duration"])
    return found


def colours(picture, index):
    picture.seek(index)
    return {tuple(pixel) for pixel in np.asarray(picture.convert("RGB")).reshape(-1, 3).tolist()}


@pytest.mark.parametrize("suffix", [".gif", ".webp"])
def test_every_step_is_shown_for_its_time_and_the_end_for_longer(tmp_path, suffix):
    picture = written(tmp_path / f"lap{suffix}")
    assert picture.n_frames == STEPS + 1
    assert durations(picture) == [100] * STEPS + [1000 * LAST]


def test_a_fast_episode_shows_fewer_steps_in_its_true_time(tmp_path):
    picture = written(tmp_path / "lap.gif", rate=50.0)
    assert durations(picture) == [40] * (STEPS // 2) + [1000 * LAST]


def test_the_last_step_is_shown_where_the_stride_leaves_it_out(tmp_path):
    assert written(tmp_path / "lap.gif", rate=75.0).n_frames == 1 + STEPS // 3 + 1


def test_a_violation_is_drawn_in_its_colour_from_when_it_happens(tmp_path):
    # The lap ends in a wall; before that only the speed is too high at times.
    found = explain(TASK, trace(STEPS), rate=10.0)
    slow = next(part for part in found.parts if part.label == "slow")
    picture = written(tmp_path / "lap.webp")
    shade = np.array(ImageColor.getrgb(VIOLATED))

    def is_drawn(step):
        return any(np.abs(np.array(colour) - shade).max() < 24 for colour in colours(picture, step))

    assert slow.first_violation == 1
    assert not is_drawn(0)
    assert is_drawn(1)


def test_without_pictures_the_panel_stands_alone(tmp_path):
    alone = written(tmp_path / "a.gif", film=Film(trouble="a log has none.")).size
    beside = written(tmp_path / "b.gif").size
    assert beside[0] == alone[0] + 60


def test_rarer_pictures_are_held(tmp_path):
    film = short_film(STEPS)
    film.frames = film.frames[::4]
    film.every = 4
    picture = written(tmp_path / "lap.gif", film=film)
    assert durations(picture) == [400] * (STEPS // 4) + [1000 * LAST]


def test_progress_counts_pictures(tmp_path):
    told = []
    found = explain(TASK, trace(3), rate=10.0)
    write_video(found, short_film(3), tmp_path / "lap.webp", lambda *pair: told.append(pair))
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_an_mp4_has_every_step(tmp_path):
    require_ffmpeg()
    path = tmp_path / "lap.mp4"
    write_video(explain(TASK, trace(STEPS), rate=10.0), short_film(STEPS), path)
    shown = subprocess.run(
        ["ffprobe", "-v", "error", "-show_entries", "stream=nb_frames", "-of", "csv=p=0", str(path)],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    assert int(shown.strip().strip(",")) == STEPS + 1 + 10 * LAST


def test_what_ffmpeg_complains_of_is_told(tmp_path):
    require_ffmpeg()
    found = explain(TASK, trace(3), rate=1e-9)
    with pytest.raises(UsageError, match=r"ffmpeg cannot write .*lap\.mp4: "):
        write_video(found, short_film(3), tmp_path / "lap.mp4")
    assert not (tmp_path / "lap.mp4").exists()


def test_names_that_cannot_be_written_are_refused(tmp_path, monkeypatch):
    with pytest.raises(UsageError, match=r"ends in \.gif, \.webp, \.mp4"):
        video.check_suffix(tmp_path / "lap.avi")
    monkeypatch.setattr(video.shutil, "which", lambda _: None)
    with pytest.raises(UsageError, match=r"needs the program ffmpeg.*take .*lap\.gif"):
        video.check_suffix(tmp_path / "lap.mp4")
