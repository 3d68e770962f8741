"""Progress, wall distances and lists of walls, on every kind of track."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hprs.carsim import track as tracks
from hprs.carsim.designs import load_track
from hprs.carsim.geometry import cross, inside, point_distances, ray_lengths
from tests.carsim.tracks import NAMES, free_points, padded, track_of, walls_of

each_track = pytest.mark.parametrize("name", NAMES)
names = st.sampled_from(NAMES)
shares = st.floats(0, 1, exclude_max=True, width=32)
progress = jax.jit(tracks.progress)
advance = jax.jit(tracks.advance)
pose_at = jax.jit(tracks.pose_at)
locate = jax.jit(tracks.locate)
many_progresses = jax.jit(jax.vmap(tracks.progress, (None, 0, None)))
many_clearances = jax.jit(jax.vmap(tracks.clearance, (None, 0)))
many_poses = jax.jit(jax.vmap(tracks.pose_at, (None, 0, 0)))
wall_distances = jax.jit(jax.vmap(tracks.wall_distance, (None, 0)))
cells = jax.jit(jax.vmap(tracks.cell_of, (None, 0)))


def room(track: tracks.Track, s: np.ndarray, share: float) -> np.ndarray:
    """Offset at a share in [-1, 1] of the way to the walls."""
    index = np.round(s / float(track.length) * tracks.POINTS).astype(int) % tracks.POINTS
    side = np.asarray(track.left if share > 0 else track.right)[index]
    return (share * side).astype(np.float32)


def numbers(listed: np.ndarray, walls: np.ndarray) -> list[int]:
    """The rows of the walls whose coordinates are listed (4, K); what only fills up has none."""
    rows = {tuple(wall): row for row, wall in enumerate(walls)}
    return [rows[wall] for wall in map(tuple, listed.T.astype(float)) if wall in rows]


@settings(max_examples=100, deadline=None)
@given(names, shares, st.floats(-0.9, 0.9), st.floats(-1.2, 1.2))
def test_progress_is_the_arc_length_a_position_was_made_from(name, share, side, since):
    track = padded(name)
    s = np.float32(share * float(track.length))
    x, y, _ = pose_at(track, s, room(track, s, side))
    found = progress(track, jnp.stack([x, y]), jnp.mod(s + since, track.length))
    assert abs(float(advance(track, s, found))) < 0.05
    assert 0 <= found < track.length


@settings(max_examples=50, deadline=None)
@given(names, shares)
def test_without_a_previous_progress_the_centre_line_is_found(name, share):
    track = padded(name)
    s = np.float32(share * float(track.length))
    x, y, _ = pose_at(track, s, 0.0)
    assert abs(float(advance(track, s, locate(track, jnp.stack([x, y]))))) < 2e-3


@each_track
@pytest.mark.parametrize("side", [-0.8, 0.0, 0.8])
@pytest.mark.parametrize("step", [0.03, 0.35])
def test_progress_of_a_car_that_drives_forward_never_falls_and_a_lap_is_the_length(
    name, side, step
):
    track = padded(name)
    number = round(float(track.length) / step)
    s = np.arange(number + 1, dtype=np.float32) * (float(track.length) / number)
    poses = many_poses(track, s, room(track, s, side))

    def drive(previous, pose):
        found = tracks.progress(track, pose[:2], previous)
        return found, tracks.advance(track, previous, found)

    first = tracks.progress(track, poses[0, :2], jnp.float32(0))
    _, moved = jax.lax.scan(drive, first, poses[1:])
    assert moved.min() >= -1e-4
    assert float(moved.sum()) == pytest.approx(float(track.length), abs=1e-2)


@each_track
def test_advance_crosses_the_start_line_both_ways(name):
    track = padded(name)
    length = float(track.length)
    assert float(advance(track, length - 0.2, 0.1)) == pytest.approx(0.3, abs=1e-4)
    assert float(advance(track, 0.1, length - 0.2)) == pytest.approx(-0.3, abs=1e-4)


@each_track
def test_positions_along_the_start_line_are_in_the_range_of_progress(name):
    track = padded(name)
    around = np.linspace(-1e-6, 1e-6, 41, dtype=np.float32)
    places = np.stack([around, np.full_like(around, 0.1)], axis=1)
    found = many_progresses(track, places, np.float32(0))
    assert ((found >= 0) & (found < track.length)).all()


@each_track
def test_the_wall_distance_is_that_of_all_walls(name):
    points = free_points(name)
    expected = point_distances(points, walls_of(name)).min(axis=1)
    np.testing.assert_allclose(
        wall_distances(padded(name), points.astype(np.float32)), expected, atol=2e-6
    )
    # The most roomy place is known to two millimetres.
    assert expected.max() <= float(track_of(name).max_clearance) + 2e-3


@each_track
def test_what_a_car_sees_is_in_the_list_of_its_cell(name):
    walls, points = walls_of(name), free_points(name)
    visible = np.asarray(track_of(name).visible)[cells(padded(name), points.astype(np.float32))]
    angles = np.linspace(0, 2 * np.pi, 240, endpoint=False)
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for point, listed in zip(points, visible, strict=True):
        starts = np.broadcast_to(point, rays.shape)
        lengths = ray_lengths(starts, rays, walls)
        allowed = np.isin(np.arange(len(walls)), numbers(listed, walls))
        in_list = np.where(allowed, lengths, np.inf).min(axis=1)
        nearest = lengths.min(axis=1)
        seen = nearest <= tracks.SIGHT
        np.testing.assert_allclose(in_list[seen], nearest[seen], atol=1e-9)


@each_track
def test_what_a_body_can_touch_is_in_the_list_of_its_cell(name):
    walls, points = walls_of(name), free_points(name)
    near = np.asarray(track_of(name).near)[cells(padded(name), points.astype(np.float32))]
    gaps = point_distances(points, walls)
    fronts = (
        cross(walls[None, :, 2:] - walls[None, :, :2], points[:, None] - walls[None, :, :2]) > 0
    )
    for listed, gap, front in zip(near, gaps, fronts, strict=True):
        assert set(np.flatnonzero((gap <= tracks.BODY_REACH) & front)) <= set(
            numbers(listed, walls)
        )


@each_track
def test_the_free_space_is_left_of_every_wall(name):
    walls = walls_of(name)
    middles = (walls[:, :2] + walls[:, 2:]) / 2
    along = walls[:, 2:] - walls[:, :2]
    normals = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.hypot(*along.T)[:, None]
    assert inside(middles + 1e-3 * normals, walls).all()
    assert not inside(middles - 1e-3 * normals, walls).any()


def test_lists_are_short():
    counts = {name: track_of(name).visible.shape[2] for name in NAMES}
    assert max(counts.values()) <= 64, counts


def test_a_batch_of_tracks_answers_as_each_track_alone():
    alone = [padded(name) for name in NAMES]
    batch = tracks.stack_tracks([track_of(name) for name in NAMES])
    points = np.stack([free_points(name, 20) for name in NAMES]).astype(np.float32)
    together = jax.jit(jax.vmap(jax.vmap(tracks.clearance, (None, 0))))(batch, points)
    for track, places, found in zip(alone, points, together, strict=True):
        separately = many_clearances(track, places)
        np.testing.assert_allclose(separately, found, rtol=1e-6)


def test_tracks_of_one_shape_share_one_compilation():
    batch = tracks.stack_tracks([track_of(name) for name in NAMES])
    one_of = [jax.tree.map(lambda leaf, i=i: leaf[i], batch) for i in range(len(NAMES))]
    compiled = jax.jit(tracks.progress)
    for track in one_of:
        compiled(track, jnp.zeros(2), jnp.float32(0))
    assert compiled._cache_size() == 1


def test_positions_off_the_grid_have_a_cell():
    track = track_of("gm")
    far = jnp.array([[-1e6, 0.0], [1e6, 0.0], [0.0, -1e6], [0.0, 1e6]])
    found = cells(track, far)
    assert ((found >= 0) & (found < track.visible.shape[0])).all()


def test_the_precision_is_that_of_the_arrays():
    with jax.enable_x64(True):
        track = load_track("gm-c", dtype=np.float64)
        pose = pose_at(track, jnp.float64(3.0), 0.1)
        found = progress(track, pose[:2], jnp.float64(2.5))
        room = jax.eval_shape(tracks.clearance, track, pose[:2])
        assert {pose.dtype, found.dtype, room.dtype} == {jnp.dtype("float64")}
        assert abs(float(found) - 3.0) < 2e-3


@pytest.mark.parametrize(
    ("place", "previous"), [((np.nan, 0.0), 0.0), ((0.0, np.nan), 0.0), ((0.0, 0.0), np.nan)]
)
def test_nan_comes_out_where_nan_went_in(place, previous):
    track, position = padded("gm"), jnp.array(place, jnp.float32)
    assert np.isnan(progress(track, position, jnp.float32(previous)))
    if np.isfinite(previous):
        assert np.isnan(locate(track, position))
        assert np.isnan(wall_distances(track, position[None])).all()
    else:
        assert np.isnan(pose_at(track, jnp.float32(previous), 0.0)).all()
