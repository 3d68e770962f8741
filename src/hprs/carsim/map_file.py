"""Tracks from the map files of ROS and RoboRacer (F1TENTH).

A map is an occupancy grid: a YAML file as ROS's `map_server` writes it, and the picture that it
names. The track is the free space around the largest obstacle, and the lap goes round that one;
what else stands in it is a wall too. Beside the map may stand a centre line as CSV with the columns
x_m, y_m, w_tr_right_m, w_tr_left_m; without one it is the middle of the free space, from the place
nearest to the map's origin.
Source: wiki.ros.org/map_server (version 0, modes trinary and scale).
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hprs.carsim.centre_line import read_centre_line
from hprs.carsim.construction import construct_track, turns_around
from hprs.carsim.geometry import (
    Points,
    closed_length,
    crossings,
    loop_segments,
    resample,
    signed_area,
    simplify,
)
from hprs.carsim.track import POINTS, Track
from hprs.errors import MissingExtraError, TrackError

try:
    import yaml
    from PIL import Image
    from scipy import ndimage
    from skimage import measure
except ModuleNotFoundError as error:
    raise MissingExtraError(str(error.name), "maps") from None

_FIELDS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
_MOST_CELLS = 100_000_000
_SMALLEST_OBSTACLE = 9
"""Cells that a track must run around, at least."""
_SPECK = 0.2
"""Both sides of what is noise of the mapping are smaller, m; a car that meets more is stopped."""
_OUTSIDE, _CORE = 1, 2
"""Labels of the cells outside of the track, and of the obstacle that the lap goes round."""
_SMOOTHING = 0.3
"""Reach of the smoothing of a centre line that was read from the grid, in m."""


_NOT_YAML = (yaml.YAMLError, ValueError, KeyError, IndexError, AttributeError, RecursionError)
"""What PyYAML raises: tagged scalars such as `!!bool x` fail in the types' own constructors."""
_NO_PICTURE = (
    OSError, SyntaxError, ValueError, TypeError, LookupError, ArithmeticError, EOFError,
    NotImplementedError, struct.error, zlib.error, Image.DecompressionBombError,
)  # fmt: skip
"""What Pillow raises of a damaged picture, by format and place of the damage."""
Labels = npt.NDArray[np.int32]


@dataclass(frozen=True)
class _Grid:
    """Where a map is free; row 0 is the lowest."""

    free: npt.NDArray[np.bool_]
    resolution: float
    """Side of a cell in m."""
    origin: tuple[float, float, float]
    """Pose of the lower left corner: x, y in m, yaw in rad."""

    def to_metres(self, cells: Points) -> Points:
        """World coordinates of (row, column), where whole numbers are the middles of cells."""
        x, y, yaw = self.origin
        local = (cells[:, ::-1] + 0.5) * self.resolution
        turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
        return local @ turn + [x, y]


def load_map(
    path: Path | str,
    *,
    centre_line: Path | str | None = None,
    reverse: bool = False,
    dtype: npt.DTypeLike | None = None,
) -> Track:
    """The track of a map.

    Args:
        path: The YAML file.
        centre_line: A CSV file in driving direction, from the start line.
        reverse: Drive the track the other way round. Without a centre line's file, forwards is
            counter-clockwise.
        dtype: Of the track's arrays; float32 unless said otherwise.

    Raises:
        TrackError: A file cannot be read, or no car could drive what is in it.
    """
    path = Path(path)
    grid = _read_map(path)
    solid = _solid(grid, path)
    grid, solid = _crop(grid, solid)
    loops, around = _outlines(grid, solid)
    if centre_line is None:
        centre = _middle(grid, solid, path)
        name = str(path)
    else:
        name = f"{path} with {centre_line}"
        centre = read_centre_line(Path(centre_line))
    return construct_track(
        centre,
        loops,
        name=name,
        reverse=reverse,
        dtype=dtype,
        measured=centre_line is None,
        around=around,
    )


def _read_map(path: Path) -> _Grid:
    fields = _read_yaml(path)
    missing = [name for name in _FIELDS if name not in fields]
    if missing:
        raise TrackError(f"{path}: lacks {', '.join(missing)}; a map_server file has them.")
    numbers = [fields["resolution"], *_pose(fields["origin"], path)]
    # Of these fields, `negate` is often written as a truth value.
    negate = fields["negate"]
    numbers += [int(negate) if isinstance(negate, bool) else negate]
    numbers += [fields[name] for name in ("occupied_thresh", "free_thresh")]
    resolution, x, y, yaw, negate, occupied, free = (_number(value, path) for value in numbers)
    if not 1e-3 <= resolution <= 1.0:
        raise TrackError(f"{path}: resolution is {resolution:g} m a cell; expected 0.001 to 1.")
    if not 0 <= free <= occupied <= 1:
        raise TrackError(f"{path}: needs 0 <= free_thresh <= occupied_thresh <= 1.")
    mode = fields.get("mode", "trinary")
    if mode not in ("trinary", "scale", "raw"):
        raise TrackError(f"{path}: mode is '{mode}'; expected trinary, scale or raw.")
    shade, white = _read_picture(path.parent / str(fields["image"]), path)
    # By shade, not by cell: a map has up to 100 million cells and few shades.
    share = np.arange(white + 1) / white
    if mode == "raw":
        # Whole numbers are the occupancy in percent; from 101 on they mean unknown.
        is_free = 255 * share <= 100 * free
    else:
        is_free = (share if negate else 1 - share) < free
    # What is transparent is unknown, in every mode.
    is_free = np.append(is_free, False)
    return _Grid(is_free[shade], resolution, (x, y, yaw))


def _read_yaml(path: Path) -> dict[str, Any]:
    try:
        fields = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise TrackError(f"{path}: cannot be read: {error.strerror}.") from None
    except _NOT_YAML:
        raise TrackError(f"{path}: is not YAML. A map is named by its YAML file.") from None
    if not isinstance(fields, dict):
        raise TrackError(f"{path}: holds no fields; a map_server file has {', '.join(_FIELDS)}.")
    return fields


def _read_picture(path: Path, source: Path) -> tuple[npt.NDArray[np.unsignedinteger], int]:
    """Shades, the lowest row first, and which one is white; one more where it is transparent."""
    try:
        with Image.open(path) as picture:
            if picture.width * picture.height <= _MOST_CELLS:
                shade, white = _shades(picture)
                return shade[::-1], white
    except FileNotFoundError:
        raise TrackError(f"{source}: names the picture {path}, which does not exist.") from None
    except _NO_PICTURE:
        raise TrackError(f"{path}: is not a picture that can be read (PNG or PGM).") from None
    raise TrackError(f"{path}: has more than {_MOST_CELLS:,} cells.")


def _shades(picture: Image.Image) -> tuple[npt.NDArray[np.unsignedinteger], int]:
    """Shades of a picture in its smallest type, and which one is white."""
    if picture.mode.startswith("I"):
        # Pillow reads 16 bits as 16 or 32.
        return np.clip(np.asarray(picture), 0, 65535).astype(np.uint16), 65535
    if picture.mode == "L" and "transparency" not in picture.info:
        return np.asarray(picture), 255
    bands = np.asarray(picture.convert("RGBA"))
    shade = bands[..., :3].sum(axis=-1, dtype=np.uint16)
    shade[bands[..., 3] == 0] = 3 * 255 + 1
    return shade, 3 * 255


def _pose(origin: object, path: Path) -> list[object]:
    if not isinstance(origin, list) or len(origin) != 3:
        raise TrackError(f"{path}: origin is {origin!r}; expected [x, y, yaw].")
    return origin


def _number(value: object, path: Path) -> float:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            raise TrackError(
                f"{path}: a whole number in it is too large to mean a place."
            ) from None
        if np.isfinite(number):
            return number
    raise TrackError(f"{path}: {value!r} stands where a number is expected.")


def _solid(grid: _Grid, path: Path) -> Labels:
    """What is not free on the track, which is the free region around the largest obstacle.

    Returns:
        0 in a free cell, _OUTSIDE, _CORE, and from 3 on for every other obstacle.
    """
    if not grid.free.any():
        raise TrackError(f"{path}: is empty: no cell is free. Is `negate` right?")
    solid, most = None, 0
    labels = _regions(grid.free, diagonally=False)
    sizes = np.bincount(labels.ravel())
    for label in np.argsort(sizes[1:])[::-1][:8] + 1:
        holes = _regions(~np.pad(labels == label, 1), diagonally=True)
        areas = np.bincount(holes.ravel())
        areas[[0, holes[0, 0]]] = 0
        if areas.max() > most:
            most = areas.max()
            order = _order(holes, outside=int(holes[0, 0]), core=int(areas.argmax()), grid=grid)
            solid = order[holes[1:-1, 1:-1]]
    if solid is None or most < _SMALLEST_OBSTACLE:
        raise TrackError(
            f"{path}: is not closed: no free region runs around an obstacle, so there is no lap. "
            "Are the walls in the picture without gaps, and free_thresh above the free cells?"
        )
    if any((edge != _OUTSIDE).any() for edge in (solid[0], solid[-1], solid[:, 0], solid[:, -1])):
        raise TrackError(f"{path}: is not closed: its free space reaches the picture's border.")
    return solid


def _regions(flags: npt.NDArray[np.bool_], *, diagonally: bool) -> Labels:
    """A label from 1 on for each set of joined cells, 0 elsewhere."""
    labels, _ = ndimage.label(flags, np.ones((3, 3)) if diagonally else None)  # pyright: ignore[reportGeneralTypeIssues]
    return np.asarray(labels, np.int32)


def _order(holes: Labels, *, outside: int, core: int, grid: _Grid) -> Labels:
    """New label of every label: specks become free, the other obstacles come after the core."""
    sides = [
        max(rows.stop - rows.start, columns.stop - columns.start) * grid.resolution
        for rows, columns in ndimage.find_objects(holes)
    ]
    order = np.zeros(len(sides) + 1, np.int32)
    large = 1 + np.flatnonzero(np.array(sides) >= _SPECK)
    others = large[(large != outside) & (large != core)]
    order[others] = np.arange(len(others)) + _CORE + 1
    order[[outside, core]] = _OUTSIDE, _CORE
    return order


def _crop(grid: _Grid, solid: Labels) -> tuple[_Grid, Labels]:
    """The part of a map that holds the track, with a border of one cell."""
    free = solid == 0
    rows, columns = np.flatnonzero(free.any(axis=1)), np.flatnonzero(free.any(axis=0))
    row, column = rows[0] - 1, columns[0] - 1
    part = np.s_[row : rows[-1] + 2, column : columns[-1] + 2]
    corner = grid.to_metres(np.array([[row - 0.5, column - 0.5]]))[0]
    origin = (float(corner[0]), float(corner[1]), grid.origin[2])
    return _Grid(grid.free[part], grid.resolution, origin), solid[part]


def _outlines(grid: _Grid, solid: Labels) -> tuple[list[Points], Points]:
    """All walls, half-way between free and other cells, and that of the core among them."""
    contours = [line[:-1] for line in measure.find_contours((solid == 0).astype(float), 0.5)]
    # A point of a contour is half-way between two cells, and one of these is free.
    ends = np.array([line[0] for line in contours])
    low, high = (solid[tuple(side(ends).astype(int).T)] for side in (np.floor, np.ceil))
    loops = _simplified([grid.to_metres(line) for line in contours], grid.resolution)
    return loops, loops[int(np.argmax(np.maximum(low, high) == _CORE))]


def _simplified(outlines: list[Points], tolerance: float) -> list[Points]:
    """Walls of fewer points that still enclose something and do not cross.

    Where a tolerance of a cell spoils a wall, it is halved: a thin wall must keep both its sides,
    and a wall through another one would be taken for one of the free space's other side.
    """
    tolerances = np.full(len(outlines), tolerance)
    while True:
        loops = [simplify(*each) for each in zip(outlines, tolerances, strict=True)]
        areas, exact = (np.array([*map(signed_area, each)]) for each in (loops, outlines))
        owner = np.repeat(np.arange(len(loops)), [len(loop) for loop in loops])
        met = crossings(np.concatenate([loop_segments(loop) for loop in loops]))
        spoilt = np.union1d(np.flatnonzero(np.abs(areas - exact) > np.abs(exact) / 2), owner[met])
        if not len(spoilt) or not tolerances[spoilt].any():
            return loops
        # Contours as they are, of steps of half a cell, do neither.
        halved = tolerances[spoilt] / 2
        tolerances[spoilt] = np.where(halved < tolerance / 8, 0, halved)


def _middle(grid: _Grid, solid: Labels, path: Path) -> Points:
    """The line that is equally far from the walls on both sides, counter-clockwise, smoothed.

    It is the medial axis without its branches into corners. An obstacle in the corridor belongs to
    the side that it is nearer to, so that the line passes it where there is more room.
    """
    to_outer, to_inner = (_distance(solid == label) for label in (_OUTSIDE, _CORE))
    others = np.arange(_CORE + 1, solid.max() + 1)
    if len(others):
        gaps = [np.asarray(ndimage.minimum(each, solid, others)) for each in (to_outer, to_inner)]
        inner = np.concatenate([[_CORE], others[gaps[1] < gaps[0]]])
        to_inner = _distance(np.isin(solid, inner))
        to_outer = _distance((solid > 0) & ~np.isin(solid, inner))
    core = np.argwhere(solid == _CORE)[0].astype(float)
    contours = [line[:-1] for line in measure.find_contours(to_outer - to_inner, 0.0)]
    contours = [line for line in contours if turns_around(line, core)]
    if not contours:
        raise TrackError(f"{path}: is too narrow: its walls leave no line between them.")
    line = grid.to_metres(max(contours, key=len))
    length = closed_length(line)
    (line,) = resample(line, POINTS)
    # On a map of absurd scale the reach would pass the whole line.
    sigma = POINTS * min(_SMOOTHING / length, 0.02)
    line = np.asarray(ndimage.gaussian_filter1d(line, sigma, axis=0, mode="wrap"))
    line = line if signed_area(line) > 0 else line[::-1]
    return np.roll(line, -int(np.hypot(*line.T).argmin()), axis=0)


def _distance(part: npt.NDArray[np.bool_]) -> Points:
    """Cells from every cell to the nearest one of a part."""
    return np.asarray(ndimage.distance_transform_edt(~part))
