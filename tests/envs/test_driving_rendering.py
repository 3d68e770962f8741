"""Pictures of the driving environments: what they show, and that they change nothing."""

from __future__ import annotations

import copy
import pickle
import sys
from dataclasses import replace
from functools import cache

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import RecordVideo

from hprs.carsim.body import BODY
from hprs.carsim.map_file import load_map
from hprs.carsim.random_track import random_track
from hprs.carsim.track import FAR, stack_tracks
from hprs.envs.driving.rendering import CAMERAS
from hprs.envs.driving.rendering.ground import ground_of
from hprs.envs.driving.rendering.panel import HEIGHT as PANEL
from hprs.envs.driving.rendering.picture import (
    CAR,
    CONTACT,
    LEADER,
    MARGIN,
    NEAR_PLACE,
    NEAR_SCALE,
    SIZE,
    Painter,
)
from hprs.envs.driving.rendering.scene import Scene
from hprs.errors import MissingExtraError, UsageError
from tests.carsim.maps import picture as map_picture
from tests.carsim.maps import write_map

from .driven import FOLLOW, SAFE, shared

WIDTH, HEIGHT = SIZE
ACTION = np.array([0.5, 0.1], np.float32)


@cache
def track_of(name):
    """A track as a stack has it."""
    if name == "random backwards":
        tracks, index = stack_tracks([random_track(4, reverse=True)]), 0
    else:
        tracks, index = shared(SAFE).simulation.tracks, ["gm", "trt"].index(name)
    return tracks, index


@cache
def painter(name, camera):
    return Painter(ground_of(*track_of(name)), camera)


def scene_at(ground, *places, **changes):
    """Cars on the centre line, at indices of its points."""
    ahead = ground.centre[np.array(places) + 1] - ground.centre[np.array(places)]
    yaw = np.arctan2(ahead[:, 1], ahead[:, 0])
    poses = np.concatenate([ground.centre[np.array(places)], yaw[:, None]], axis=1)
    scene = Scene(
        poses=poses,
        wheels=np.zeros(len(places)),
        scan=np.full(64, 0.4),
        reach=15.0,
        trail=poses[None, :, :2],
        speed=2.0,
        steering=0.0,
        progress=0.5,
        lead=None,
        hit_wall=False,
        hit_car=False,
    )
    return replace(scene, **changes)


def places_of(picture, colour):
    """Pixels of a colour above the panel, as (x, y)."""
    rows, columns = np.nonzero((picture[: HEIGHT - PANEL] == colour).all(axis=-1))
    return np.stack([columns, rows], axis=1) + 0.5


def pixel_of(tracks, index, place):
    """Where the fixed camera shows a place, from the walls alone."""
    walls = np.asarray(tracks.walls[index], float)
    walls = walls[walls[:, 0] < FAR]
    low, high = walls[:, :2].min(axis=0), walls[:, :2].max(axis=0)
    scale = min((np.array([WIDTH, HEIGHT - PANEL]) - 2 * MARGIN) / (high - low))
    x, y = (place - (low + high) / 2) * scale
    return np.array([WIDTH / 2 + x, (HEIGHT - PANEL) / 2 - y]), scale


@pytest.mark.parametrize("name", ["gm", "trt", "random backwards"])
@pytest.mark.parametrize("index", [3, 400, 800])
def test_the_fixed_camera_shows_the_cars_where_they_are(name, index):
    draw = painter(name, "fixed")
    scene = scene_at(draw.ground, index, (index + 120) % 1000)
    picture = draw.paint(scene)
    for pose, colour in zip(scene.poses, (CAR, LEADER), strict=True):
        expected, scale = pixel_of(*track_of(name), pose[:2])
        # Of a car that would be shorter than 20 pixels, so much is drawn.
        scale = max(scale, 20 / BODY.length)
        found = places_of(picture, colour)
        assert len(found) > 10
        # The body's colour is spread evenly around the centre of mass, up to the cockpit.
        assert np.abs(found.mean(axis=0) - expected).max() < 0.08 * scale
        assert np.hypot(*(found - expected).T).max() < 0.33 * scale


@pytest.mark.parametrize("name", ["gm", "random backwards"])
def test_the_following_camera_keeps_the_car_in_its_place_with_its_heading_up(name):
    draw = painter(name, "follow")
    scene = scene_at(draw.ground, 300, 330)
    picture = draw.paint(scene)
    here = np.array([WIDTH / 2, NEAR_PLACE * (HEIGHT - PANEL)])
    found = places_of(picture, CAR)
    near = found[np.hypot(*(found - here).T) < NEAR_SCALE * 0.4]
    assert len(near) > 100
    assert np.abs(near.mean(axis=0) - here).max() < 0.08 * NEAR_SCALE
    # The leader is ahead: by complex numbers, the heading of the car turned up.
    apart = complex(*(scene.poses[1] - scene.poses[0])[:2]) * NEAR_SCALE
    turned = apart * np.exp(1j * (np.pi / 2 - scene.poses[0, 2]))
    there = here + np.array([turned.real, -turned.imag])
    assert there[1] < here[1] - 0.3 * NEAR_SCALE
    found = places_of(picture, LEADER)
    near = found[np.hypot(*(found - there).T) < NEAR_SCALE * 0.4]
    assert len(near) > 100
    assert np.abs(near.mean(axis=0) - there).max() < 0.08 * NEAR_SCALE


def test_a_map_file_is_drawn(tmp_path):
    free, corner = map_picture("gm-c")
    track = load_map(write_map(tmp_path, free, origin=(*corner, 0.0)))
    stack = stack_tracks([track])
    draw = Painter(ground_of(stack, 0), "fixed")
    scene = scene_at(draw.ground, 200)
    expected, _ = pixel_of(stack, 0, scene.poses[0, :2])
    found = places_of(draw.paint(scene), CAR)
    assert np.abs(found.mean(axis=0) - expected).max() < 3


def test_wheels_trail_lidar_and_panel_are_of_the_scene():
    draw = painter("gm", "follow")
    scene = scene_at(draw.ground, 300)
    plain = draw.paint(scene)
    trail = draw.ground.centre[280:301, None]
    strip = slice(HEIGHT - PANEL, None)
    for change in (
        {"wheels": np.array([0.3])},
        {"trail": trail},
        {"scan": np.full(64, 0.6)},
        {"scan": np.full(8, 0.4)},
    ):
        changed = draw.paint(replace(scene, **change))
        assert (changed != plain).any()
        assert np.array_equal(changed[strip], plain[strip])
    for change in ({"speed": 3.0}, {"steering": -0.4}, {"progress": -0.1}, {"lead": 1.5}):
        changed = draw.paint(replace(scene, **change))
        assert (changed[strip] != plain[strip]).any()
        assert np.array_equal(changed[:-PANEL], plain[:-PANEL])


@pytest.mark.parametrize("contact", ["hit_wall", "hit_car"])
def test_a_contact_is_marked(contact):
    draw = painter("gm", "fixed")
    scene = scene_at(draw.ground, 300, 310, lead=0.4)
    assert not len(places_of(draw.paint(scene), CONTACT))
    assert len(places_of(draw.paint(replace(scene, **{contact: True})), CONTACT)) > 50


def test_a_small_car_on_a_large_track_can_still_be_seen():
    draw = painter("gm", "fixed")
    ground = replace(
        draw.ground,
        loops=tuple(30 * loop for loop in draw.ground.loops),
        centre=30 * draw.ground.centre,
        left=30 * draw.ground.left,
        right=30 * draw.ground.right,
        length=30 * draw.ground.length,
    )
    picture = Painter(ground, "fixed").paint(scene_at(ground, 300))
    assert len(places_of(picture, CAR)) > 10


@pytest.fixture(scope="module")
def drawn():
    """An environment for each camera, without a time limit."""
    return {c: gym.make(SAFE, render_mode="rgb_array", camera=c).unwrapped for c in CAMERAS}


def test_rendering_changes_no_number(drawn):
    plain = shared(SAFE)
    for env in (plain, *drawn.values()):
        env.reset(seed=3)
    for _ in range(12):
        steps = [env.step(ACTION) for env in (plain, *drawn.values())]
        drawn["fixed"].render()
        for other in steps[1:]:
            assert np.array_equal(steps[0][0], other[0])
            assert steps[0][1:] == other[1:]
    follow = drawn["follow"].render()
    assert follow.shape == (HEIGHT, WIDTH, 3)
    assert follow.dtype == np.uint8
    assert not np.array_equal(follow, drawn["fixed"].render())
    # Twelve steps at once are the trail that twelve pictures were.
    assert np.array_equal(copy.deepcopy(drawn["fixed"]).render(), drawn["fixed"].render())
    for env in drawn.values():
        assert plain.np_random.bit_generator.state == env.np_random.bit_generator.state


def test_drivers_that_know_everything_can_read_the_state():
    env = gym.make(SAFE).unwrapped
    with pytest.raises(UsageError, match="no episode before reset"):
        _ = env.episode
    env.reset(seed=3)
    signals = env.step(ACTION)[4]["signals"]
    episode = env.episode
    assert episode.commands[-1].tolist() == [signals["steering"], signals["speed_command"]]
    assert episode.world.distance[0] / env.simulation.tracks.length[episode.track] == (
        pytest.approx(signals["progress"], abs=1e-6)
    )


def test_the_picture_is_of_the_running_episode(drawn):
    env = drawn["follow"]
    env.reset(seed=3)
    first = env.render()
    env.step(ACTION)
    env.step(ACTION)
    assert not np.array_equal(env.render(), first)
    twin = pickle.loads(pickle.dumps(env))
    assert np.array_equal(twin.render(), env.render())
    env.reset(seed=3)
    assert np.array_equal(env.render(), first)


def test_pictures_of_gymnasium_s_other_modes(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = gym.make(SAFE, render_mode="rgb_array_list")
    env.reset(seed=0)
    env.step(ACTION)
    assert [frame.shape for frame in env.render()] == [(HEIGHT, WIDTH, 3)] * 2
    pytest.importorskip("pygame")
    with pytest.warns(UserWarning, match="HumanRendering"):
        window = gym.make(SAFE, render_mode="human")
    window.reset(seed=0)
    window.step(ACTION)
    window.close()


def test_a_film_can_be_recorded(tmp_path):
    pytest.importorskip("moviepy")
    env = RecordVideo(gym.make(SAFE, render_mode="rgb_array"), str(tmp_path))
    env.reset(seed=0)
    env.step(ACTION)
    env.close()
    assert [file.suffix for file in tmp_path.iterdir()] == [".mp4"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"render_mode": "human"}, "render_mode is rgb_array or None, not 'human'."),
        ({"render_mode": []}, "render_mode is rgb_array or None, not []."),
        ({"camera": None}, "camera is fixed or follow, not None."),
        ({"camera": "Follow"}, "camera is fixed or follow, not 'Follow'. Did you mean 'follow'?"),
    ],
)
def test_an_unknown_mode_or_camera_is_one_clear_error(drawn, options, message):
    with pytest.raises(UsageError) as caught:
        type(drawn["fixed"])(**options)
    assert str(caught.value) == message


@pytest.mark.parametrize("option", [{"render_mode": "rgb_array"}, {"camera": "follow"}])
@pytest.mark.parametrize("name", [SAFE, FOLLOW])
def test_many_environments_draw_nothing(name, option):
    with pytest.raises(UsageError, match=f"There is no option '{next(iter(option))}'"):
        gym.make_vec(name, 2, **option)


def test_a_picture_before_the_first_reset_or_without_a_mode_is_refused():
    with pytest.raises(UsageError, match=r"render\(\) was called before reset"):
        gym.make(SAFE, render_mode="rgb_array").unwrapped.render()
    with pytest.raises(UsageError, match="Nothing is drawn without a mode"):
        gym.make(SAFE).unwrapped.render()


def test_a_missing_pillow_names_the_extra(drawn, monkeypatch):
    for name in [name for name in sys.modules if name.startswith("hprs.envs.driving.rendering.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "PIL", None)
    with pytest.raises(MissingExtraError, match=r"Pillow is not installed.*'hprs\[report\]'"):
        type(drawn["fixed"])("rgb_array")
    type(drawn["fixed"])().close()
