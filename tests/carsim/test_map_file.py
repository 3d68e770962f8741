"""Map files: the formats, and one clear error for everything that is wrong with one."""

from __future__ import annotations

import tracemalloc
import warnings
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

from hprs.carsim import map_file
from hprs.carsim import track as tracks
from hprs.carsim.collision import touches_wall
from hprs.carsim.construction import turns_around
from hprs.carsim.geometry import inside, loop_segments, point_distances
from hprs.carsim.lidar import beam_angles, measure
from hprs.carsim.map_file import load_map
from hprs.carsim.vehicle import at_rest
from hprs.errors import TrackError
from tests.carsim.maps import march, picture, write_centre_line, write_map
from tests.carsim.tracks import track_of, walls_of

FREE, CORNER = picture("gm")
scans = jax.jit(jax.vmap(measure, (None, 0)))


@pytest.fixture
def gm_map(tmp_path):
    return write_map(tmp_path, FREE, origin=(*CORNER, 0.0))


def far_from(name: str, points) -> float:
    line = np.asarray(track_of(name).centre, float)
    return float(point_distances(np.asarray(points, float), loop_segments(line)).min(axis=1).max())


def test_walls_are_within_a_cell_of_the_real_ones(gm_map):
    walls = np.asarray(load_map(gm_map).walls, float)
    gaps = point_distances(walls[:, :2], walls_of("gm")).min(axis=1)
    assert gaps.max() <= 0.05 + 0.02 + 0.025


def test_the_middle_of_the_free_space_is_the_centre_line(gm_map):
    track = load_map(gm_map)
    assert far_from("gm", track.centre) < 0.06
    assert float(track.length) == pytest.approx(21.25, rel=0.01)


def test_a_centre_line_may_stand_beside_the_map(gm_map, tmp_path):
    track = load_map(gm_map, centre_line=write_centre_line(tmp_path, "gm"))
    assert float(track.length) == pytest.approx(21.25, abs=0.01)
    np.testing.assert_allclose(track.centre[0], 0, atol=1e-6)


def test_both_directions_can_be_driven(gm_map):
    forwards, backwards = load_map(gm_map), load_map(gm_map, reverse=True)
    np.testing.assert_allclose(forwards.centre[0], backwards.centre[0], atol=1e-5)
    np.testing.assert_allclose(forwards.centre[1], backwards.centre[-1], atol=1e-5)


@pytest.mark.parametrize(
    ("name", "beside", "reverse"),
    [("gm", False, False), ("gm", False, True), ("gm", True, False), ("gm", True, True), ("trt", False, False)],
)  # fmt: skip
def test_the_lidar_is_within_a_cell_of_a_march_over_the_picture(tmp_path, name, beside, reverse):
    free, corner = (FREE, CORNER) if name == "gm" else picture(name)
    path = write_map(tmp_path, free, origin=(*corner, 0.0))
    line = write_centre_line(tmp_path, name) if beside else None
    track = load_map(path, centre_line=line, reverse=reverse)
    generator = np.random.default_rng(0)
    index = generator.integers(tracks.POINTS, size=80)
    room = np.asarray(track.left)[index] - 0.15, np.asarray(track.right)[index] - 0.15
    places = index / tracks.POINTS * float(track.length), generator.uniform(-room[1], room[0])
    poses = np.asarray(jax.vmap(partial(tracks.pose_at, track))(*places)).copy()
    poses[:, 2] += generator.uniform(-np.pi, np.pi, len(poses))
    found = np.asarray(scans(track, at_rest(*jnp.asarray(poses.T))))
    nominal, least, most, step = march(free, corner, poses, beam_angles())
    # A wall that is a cell off moves the end of a grazing beam by many: the bounds are those of
    # beams that keep a cell away from walls, and of beams that go a cell deep into them.
    assert (found >= least - step).all()
    assert (found <= most + step).all()
    assert (np.abs(found - nominal) <= 0.05 + step).mean() > 0.8
    assert (most - least < 0.5).mean() > 0.8


@pytest.mark.parametrize(
    "changes",
    [{"negate": 1}, {"suffix": ".pgm"}, {"mode": "scale"}, {"free_thresh": 0.05}],
    ids=lambda change: "".join(change),
)
def test_every_way_to_write_a_map_gives_the_same_track(gm_map, tmp_path, changes):
    folder = tmp_path / "other"
    folder.mkdir()
    other = write_map(folder, FREE, origin=(*CORNER, 0.0), **changes)
    np.testing.assert_array_equal(load_map(other).walls, load_map(gm_map).walls)


def test_the_origin_turns_the_map(gm_map, tmp_path):
    folder = tmp_path / "other"
    folder.mkdir()
    x, y = CORNER
    turned = load_map(write_map(folder, FREE, origin=(-y, x, np.pi / 2)))
    straight = load_map(gm_map)
    expected = np.stack([-straight.centre[:, 1], straight.centre[:, 0]], axis=1)
    np.testing.assert_allclose(turned.centre, expected, atol=1e-4)


def test_speckles_in_the_corridor_are_noise(gm_map, tmp_path):
    folder = tmp_path / "other"
    folder.mkdir()
    speckled = FREE.copy()
    row, column = ((np.zeros(2) - CORNER) / 0.05).astype(int)[::-1]
    speckled[row : row + 2, column : column + 2] = False
    other = load_map(write_map(folder, speckled, origin=(*CORNER, 0.0)))
    np.testing.assert_array_equal(other.walls, load_map(gm_map).walls)


def hall(*blocks, size=(8.0, 6.0)):
    """Free cells of a room with blocks (x0, y0, x1, y1) in m; the picture's corner is (0, 0)."""
    free = np.zeros((int(size[1] / 0.05), int(size[0] / 0.05)), bool)
    free[10:-10, 10:-10] = True
    for block in blocks:
        x0, y0, x1, y1 = np.round(np.array(block) / 0.05).astype(int)
        free[y0:y1, x0:x1] = False
    return free


CORE = (3.0, 2.5, 5.0, 3.5)
"""In a hall of 8 m x 6 m this block leaves a corridor of 2 m on all sides, or 2.5 m."""


def free_poses(free, number=60, room=0.3):
    """Poses of cars whose centres are away from walls, on a map with its corner in (0, 0)."""
    generator = np.random.default_rng(0)
    away = ndimage.distance_transform_edt(free) * 0.05 > room
    places = generator.permutation(np.argwhere(away))[:number, ::-1] * 0.05 + 0.025
    return np.column_stack([places, generator.uniform(-np.pi, np.pi, len(places))])


OBSTACLES = {
    "a pillar of 0.7 m x 0.5 m": hall(CORE, (3.5, 0.8, 4.2, 1.3)),
    "a pillar at the inner wall": hall(CORE, (3.7, 1.9, 4.4, 2.4)),
    "a thin wall": hall(CORE, (1.0, 2.0, 1.05, 4.0)),
    "a post of 0.2 m": hall(CORE, (1.0, 2.0, 1.2, 2.2)),
    "two blocks": hall(CORE, (8.0, 2.5, 9.0, 3.5), size=(12.0, 6.0)),
}


@pytest.mark.parametrize("free", OBSTACLES.values(), ids=OBSTACLES)
def test_what_stands_in_the_corridor_is_a_wall_and_the_lap_passes_it(tmp_path, free):
    track = load_map(write_map(tmp_path, free))
    walls = np.asarray(track.walls, float)
    # Every cell's middle is free by the walls as it is in the picture.
    rows, columns = np.indices(free.shape)
    middles = np.stack([columns.ravel() + 0.5, rows.ravel() + 0.5], axis=1) * 0.05
    sure = point_distances(middles, walls).min(axis=1) > 0.05
    np.testing.assert_array_equal(inside(middles, walls)[sure], free.ravel()[sure])
    line = np.asarray(track.centre, float)
    assert turns_around(line, np.array([4.0, 3.0])) == 1
    assert point_distances(line, walls).min() > 0.2
    poses = free_poses(free)
    found = np.asarray(scans(track, at_rest(*jnp.asarray(poses.T, jnp.float32))))
    _, least, most, step = march(free, (0.0, 0.0), poses, beam_angles())
    assert (found >= least - step).all()
    assert (found <= most + step).all()


def test_a_car_cannot_drive_through_a_pillar(tmp_path):
    track = load_map(write_map(tmp_path, OBSTACLES["a pillar of 0.7 m x 0.5 m"]))
    x = jnp.asarray([2.5, 3.0, 3.35, 4.35, 4.7, 5.2])
    cars = at_rest(x, jnp.full(6, 1.0), jnp.zeros(6))
    touched = jax.vmap(touches_wall, (None, 0))(track, cars)
    assert touched.tolist() == [False, False, True, True, False, False]


def test_a_pillar_that_leaves_no_room_is_refused_with_its_place(tmp_path):
    path = write_map(tmp_path, hall(CORE, (3.5, 0.8, 4.2, 2.2)))
    with pytest.raises(TrackError, match=r"near \([34]\.\d+, [02]\.\d+\) m; a car needs 0.2 m"):
        load_map(path)


def test_specks_below_a_fifth_of_a_metre_are_noise(tmp_path):
    folder = tmp_path / "other"
    folder.mkdir()
    speckled = load_map(write_map(folder, hall(CORE, (1.2, 2.0, 1.2 + 0.15, 2.0 + 0.15))))
    clean = load_map(write_map(tmp_path, hall(CORE)))
    np.testing.assert_array_equal(speckled.walls, clean.walls)


def test_a_centre_line_must_go_round_the_largest_obstacle(tmp_path):
    path = write_map(tmp_path, hall(CORE, (8.0, 2.5, 9.0, 3.5), size=(12.0, 6.0)))
    angle = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    line = tmp_path / "line.csv"
    for x, y, reach, fits in (
        (6.5, 3.0, 1.0, False),
        (8.5, 3.0, 1.3, False),
        (4.0, 3.0, 1.8, True),
    ):
        centre = np.stack([x + reach * np.cos(angle), y + reach * np.sin(angle)], axis=1)
        np.savetxt(line, centre, delimiter=",")
        if fits:
            assert load_map(path, centre_line=line).length == pytest.approx(11.3, abs=0.1)
        else:
            with pytest.raises(TrackError, match=f"{line}: its centre line is no lap"):
                load_map(path, centre_line=line)


def cut(free):
    gap = free.copy()
    row = int((0 - CORNER[1]) / 0.05)
    column = int((0 - CORNER[0]) / 0.05)
    gap[: row + 31, column - 3 : column + 3] = False
    return gap


def narrow(free):
    gap = cut(free)
    row, column = ((np.zeros(2) - CORNER) / 0.05).astype(int)[::-1]
    gap[row - 1 : row + 2, column - 3 : column + 3] = True
    return gap


def a_ring_of_one_cell():
    ring = np.zeros((200, 200), bool)
    ring[20:180, 20:180] = True
    ring[21:179, 21:179] = False
    return ring


@pytest.mark.parametrize(
    ("free", "changes", "message"),
    [
        (np.zeros_like(FREE), {}, "is empty: no cell is free"),
        (np.ones_like(FREE), {}, "is not closed: no free region runs around an obstacle"),
        (cut(FREE), {}, "is not closed: no free region runs around an obstacle"),
        (narrow(FREE), {}, r"a wall is 0\.\d\d m from its centre line near"),
        (FREE[15:], {}, "its free space reaches the picture's border"),
        (FREE, {"resolution": 0.001}, r"is 0\.4\d+ m long, which is not within 5 m and 1000 m"),
        (FREE, {"resolution": 50}, "resolution is 50 m a cell; expected 0.001 to 1"),
        (FREE, {"resolution": "wide"}, "'wide' stands where a number is expected"),
        (FREE, {"resolution": None}, "lacks resolution; a map_server file has them"),
        (FREE, {"resolution": "true"}, "True stands where a number is expected"),
        (FREE, {"origin": (np.nan, 0.0, 0.0)}, "'nan' stands where a number is expected"),
        (FREE, {"origin": (5e5, 5e6, 0.0)}, r"is 5e\+06 m from \(0, 0\); within 10000 m positions"),
        (FREE, {"origin": (0.0, 0.0)}, r"origin is \[0.0, 0.0\]; expected \[x, y, yaw\]"),
        (FREE, {"free_thresh": 0.7}, "needs 0 <= free_thresh <= occupied_thresh <= 1"),
        (FREE, {"mode": "grey"}, "mode is 'grey'; expected trinary, scale or raw"),
        (FREE, {"image": "other.png"}, "other.png, which does not exist"),
        (FREE, {"image": "."}, "is not a picture that can be read"),
        (
            a_ring_of_one_cell(),
            {"origin": (0.0, 0.0, 0.0)},
            r"is too narrow near .* no room between",
        ),
    ],
)
def test_a_wrong_map_gives_one_error_that_names_file_and_reason(tmp_path, free, changes, message):
    path = write_map(tmp_path, free, **({"origin": (*CORNER, 0.0)} | changes))
    with pytest.raises(TrackError, match=message) as caught:
        load_map(path)
    assert str(tmp_path) in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "cannot be read: No such file"),
        ("a: [", "is not YAML"),
        ("- 1", "holds no fields"),
        ("", "holds no fields"),
        (b"\x89PNG", "is not YAML. A map is named by its YAML file"),
    ],
)
def test_a_file_that_is_no_map_is_named(tmp_path, text, message):
    path = tmp_path / "map.yaml"
    if text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(TrackError, match=f"map.yaml: {message}"):
        load_map(path)


@pytest.mark.parametrize("text", [f"1{'0' * 400}", "9" * 5000, "!!bool x", "!!timestamp x"])
def test_a_value_that_no_number_holds_is_one_error(tmp_path, text):
    for field in ("resolution", "negate", "free_thresh"):
        path = write_map(tmp_path, np.zeros((4, 4), bool), **{field: text})
        with pytest.raises(
            TrackError, match=r"map\.yaml: (is not YAML|a whole number in it is too)"
        ):
            load_map(path)


def damaged(data: bytes, generator) -> bytes:
    """A file with some bytes changed, missing or added, seldom in its head."""
    changed = bytearray(data)
    for _ in range(generator.integers(1, 4)):
        at = int(generator.integers(len(changed) if generator.random() < 0.5 else 60))
        match generator.integers(4):
            case 0:
                changed[at] = generator.integers(256)
            case 1:
                del changed[at : at + int(generator.integers(1, 20))]
            case 2:
                changed[at:at] = generator.bytes(int(generator.integers(1, 20)))
            case _:
                del changed[max(at, 70) :]
    return bytes(changed)


@pytest.mark.parametrize("suffix", [".png", ".pgm", ".bmp"])
def test_a_damaged_picture_is_a_map_or_one_error(tmp_path, suffix):
    # A map that is empty: whatever still is a picture is refused as well, with its reason.
    path = write_map(tmp_path, np.zeros((40, 50), bool), suffix=suffix)
    picture = tmp_path / f"map{suffix}"
    data, generator = picture.read_bytes(), np.random.default_rng(0)
    texts = [b"", data[:40], b"P5 50 x 255\n", b"P5 50 40 0\n", b"P5 99999999 99999999 255\n"]
    texts += [b"P2 2 2 255 1 2 x 4", b"\x89PNG nonsense"]
    texts += [damaged(data, generator) for _ in range(200)]
    for text in texts:
        picture.write_bytes(text)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with pytest.raises(TrackError, match=r"is not a picture|is empty|is not closed|cells"):
                load_map(path)


def test_a_broken_png_is_named(tmp_path):
    path = write_map(tmp_path, np.zeros((40, 50), bool))
    picture = tmp_path / "map.png"
    # The second chunk's name: Pillow's own error is a SyntaxError.
    picture.write_bytes(picture.read_bytes().replace(b"IDAT", b"I\x00AT"))
    with pytest.raises(TrackError, match=r"map\.png: is not a picture that can be read"):
        load_map(path)


def is_free(folder, image: Image.Image, name: str = "map.png", **changes) -> bool:
    """Whether the only cell of a map is free: either way it is refused, for different reasons."""
    path = write_map(folder, np.zeros((1, 1), bool), suffix=".bmp", image=name, **changes)
    image.save(folder / name)
    with pytest.raises(TrackError, match=r"is empty|is not closed") as caught:
        load_map(path)
    return "is not closed" in str(caught.value)


@pytest.mark.parametrize(
    ("pixels", "mode", "changes", "free"),
    [
        # In percent: free_thresh is 0.196, and from 101 on nothing is known.
        ([0, 19, 20, 100, 101, 255], "L", {"mode": "raw"}, [True, True, False, False, False, False]),
        ([0, 50, 51, 100], "L", {"mode": "raw", "free_thresh": 0.5}, [True, True, False, False]),
        # Occupancy is 1 - shade / 255, and free is below 0.196: from a shade of 206 on.
        ([205, 206, 255], "L", {}, [False, True, True]),
        ([49, 50, 0], "L", {"negate": 1}, [True, False, True]),
        ([205 * 257, 206 * 257, 52_690, 65_535, 0], "I;16", {}, [False, True, False, True, False]),
        ([0, 12_000, 13_000], "I;16", {"negate": 1}, [True, True, False]),
        ([(255, 255), (255, 0), (255, 1), (0, 255)], "LA", {}, [True, False, True, False]),
        ([(255, 255), (0, 0), (0, 255)], "LA", {"negate": 1}, [False, False, True]),
        ([(0, 255), (0, 0)], "LA", {"mode": "raw"}, [True, False]),
        ([(255, 255, 255, 255), (255, 255, 255, 0), (255, 255, 0, 255)], "RGBA", {}, [True, False, False]),
        ([(255, 255, 255), (210, 206, 202), (208, 205, 202)], "RGB", {}, [True, True, False]),
        ([0, 1], "1", {}, [False, True]),
    ],
)  # fmt: skip
def test_shades_are_free_by_mode_depth_and_transparency(tmp_path, pixels, mode, changes, free):
    images = [Image.new(mode, (1, 1), pixel) for pixel in pixels]
    assert [is_free(tmp_path, image, **changes) for image in images] == free


def test_a_16_bit_pgm_and_a_transparent_shade_are_read(tmp_path):
    for shade, free in ((205 * 257, False), (65_535, True), (0, False)):
        deep = Image.fromarray(np.full((1, 1), shade, np.uint16))
        assert is_free(tmp_path, deep, "map.pgm") == free
    for shade, free in ((254, False), (255, True)):
        grey = Image.new("L", (1, 1), shade)
        grey.save(tmp_path / "see.png", transparency=254)
        with Image.open(tmp_path / "see.png") as picture:
            assert is_free(tmp_path, picture) == free


def test_a_large_picture_is_read_in_small_types(tmp_path):
    cells = 4_000_000
    Image.new("RGBA", (2000, 2000), (255, 255, 255, 0)).save(tmp_path / "map.png")
    path = write_map(tmp_path, np.zeros((4, 4), bool), suffix=".bmp", image="map.png")
    tracemalloc.start()
    try:
        with pytest.raises(TrackError, match="is empty"):
            load_map(path)
        # Four bytes a cell for the picture itself, two for its shades, one for what is free.
        assert tracemalloc.get_traced_memory()[1] < 12 * cells
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda rows: None, "centerline.csv: cannot be read"),
        (lambda rows: ["\udcff"], "is not text"),
        (lambda rows: [], "holds 0 points"),
        (lambda rows: rows[:4], "holds 3 points"),
        (lambda rows: rows[:100], "is not closed: its last point is"),
        (lambda rows: [*rows, "1.0"], "a row lacks a number"),
        (lambda rows: [*rows, "nan, 1.0, 1, 1"], "not a finite number"),
        (
            lambda rows: [
                rows[0],
                *(f"{2 + float(r.split(',')[0])},{r.split(',')[1]}" for r in rows[1:]),
            ],
            "leaves the free space near .* Do the centre line and the map belong together",
        ),
        (
            lambda rows: [*rows[:50], *rows[60:50:-1], *rows[61:]],
            "crosses itself|leaves the free space",
        ),
    ],
    ids=["missing", "binary", "empty", "few", "open", "short row", "nan", "elsewhere", "folded"],
)
def test_a_wrong_centre_line_gives_one_error(gm_map, tmp_path, edit, message):
    path = write_centre_line(tmp_path, "gm")
    rows = edit(path.read_text().splitlines())
    if rows is None:
        path.unlink()
    else:
        path.write_text("\n".join(rows) + "\n", errors="surrogateescape")
    with pytest.raises(TrackError, match=message) as caught:
        load_map(gm_map, centre_line=path)
    assert str(path) in str(caught.value)


def heading(head: str, row: str, points: int = 60) -> str:
    """A file of a circle with a radius of 1.8 m round (4, 3)."""
    angle = np.linspace(0, 2 * np.pi, points, endpoint=False)
    rows = [row.format(x=4 + 1.8 * np.cos(a), y=3 + 1.8 * np.sin(a), s=1.8 * a) for a in angle]
    return "\n".join([head, *rows] if head else rows) + "\n"


@pytest.mark.parametrize(
    "text",
    [
        heading("", "{x},{y}"),
        heading("", "\ufeff{x},{y}").replace("\n\ufeff", "\n"),
        heading("\ufeffx_m,y_m", "{x},{y}"),
        heading("s;x;y", "{s};{x};{y}"),
        heading("# 3f2c1ab\n# made for a test\n# s_m; x_m; y_m; vx", "{s}; {x}; {y}; 1"),
        heading("# made for a test, by hand, in 2024", "{x},{y}"),
        heading('"Y","X"', '"{y}","{x}",'),
        heading("y_m,x_m", "{y},{x}\n"),
    ],
    ids=[
        "bare",
        "mark",
        "mark and head",
        "x and y",
        "raceline",
        "comment",
        "quoted",
        "blank lines",
    ],
)
def test_every_way_to_write_a_centre_line_gives_the_same_points(tmp_path, monkeypatch, text):
    line = tmp_path / "line.csv"
    line.write_bytes(text.encode())
    given = []
    monkeypatch.setattr(map_file, "construct_track", lambda centre, *_, **__: given.append(centre))
    load_map(write_map(tmp_path, hall(CORE)), centre_line=line)
    (points,) = given
    assert points.shape == (60, 2)
    np.testing.assert_allclose(np.hypot(*(points - [4, 3]).T), 1.8)
    np.testing.assert_allclose(points[0], [5.8, 3.0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            heading("s;lat;lon", "{s};{x};{y}"),
            "names the columns s, lat, lon; a centre line has x_m",
        ),
        (heading("# a, b", "{x},{y}"), "names the columns a, b; a centre line has x_m and y_m"),
        (
            heading("x_m;y_m", "{x};{y}").replace(".", ","),
            r":2: .* have decimal commas; write points",
        ),
        (heading("", "{x};{y}").replace(".", ","), r":1: .* have decimal commas; write points"),
        (heading("x_m,y_m", "{x},{y}").replace(".", ","), r":2: has 4 cells under 2 names"),
        (heading("x_m,y_m", "{x},{y}") + "end,1\n", r":62: a row lacks a number in .* x_m and y_m"),
        (heading("x_m,y_m", "{x},{y}") + "a,b\n", r":62: a row lacks a number"),
        (heading("", "{x} {y}"), "holds 0 points"),
        (heading("", "{x}"), ":1: a row lacks a number in the columns 1 and 2"),
    ],
)
def test_columns_that_cannot_be_told_are_refused(gm_map, tmp_path, text, message):
    line = tmp_path / "line.csv"
    line.write_text(text)
    with pytest.raises(TrackError, match=message) as caught:
        load_map(gm_map, centre_line=line)
    assert str(line) in str(caught.value)
