"""Map files for tests: built-in designs as pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image
from scipy import ndimage

from hprs.carsim.construction import walls_beside
from hprs.carsim.designs import DESIGNS, trace
from hprs.carsim.geometry import inside, loop_segments, resample
from tests.carsim import plain


def picture(name: str, *, resolution: float = 0.05, margin: float = 0.5):
    """Free cells of a design, the lowest row first, and the lower left corner in m."""
    centre, width = trace(DESIGNS[name])
    walls = np.concatenate(
        [loop_segments(loop) for loop in walls_beside(centre, width / 2, width / 2, name=name)]
    )
    low, high = walls[:, :2].min(axis=0) - margin, walls[:, :2].max(axis=0) + margin
    x, y = (np.arange(a + resolution / 2, b, resolution) for a, b in zip(low, high, strict=True))
    rows = [inside(np.stack([x, np.full_like(x, height)], axis=1), walls) for height in y]
    return np.array(rows), (float(low[0]), float(low[1]))


def write_map(
    folder: Path,
    free: np.ndarray,
    *,
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    resolution: float = 0.05,
    negate: int = 0,
    suffix: str = ".png",
    **changes: object,
) -> Path:
    """A YAML file and its picture; changes replace or, as None, remove fields."""
    shade = np.where(free != bool(negate), 254, 0).astype(np.uint8)
    Image.fromarray(shade[::-1]).save(folder / f"map{suffix}")
    fields: dict[str, object] = {
        "image": f"map{suffix}",
        "resolution": resolution,
        "origin": list(origin),
        "negate": negate,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    } | changes
    path = folder / "map.yaml"
    lines = [f"{key}: {value}" for key, value in fields.items() if value is not None]
    path.write_text("\n".join(lines) + "\n")
    return path


def write_centre_line(folder: Path, name: str, *, points: int = 200) -> Path:
    """A design's centre line as CSV."""
    centre, width = resample(*(lambda c, w: (c, points, w))(*trace(DESIGNS[name])))
    rows = [
        f"{x:.6f}, {y:.6f}, {w / 2:.4f}, {w / 2:.4f}"
        for (x, y), w in zip(centre, width, strict=True)
    ]
    path = folder / "centerline.csv"
    path.write_text("# x_m, y_m, w_tr_right_m, w_tr_left_m\n" + "\n".join(rows) + "\n")
    return path


def march(free: np.ndarray, corner: tuple[float, float], poses: np.ndarray, angles: np.ndarray):
    """Readings of lidars on cars at poses (P, 3), from nothing but the picture: by small steps.

    Returns:
        Distances to the first cell that is not free; to the first place less than a cell from one;
        to the first place that is further than a cell from all free ones; each (P, B) m. And the step.
    """
    split, resolution = 4, 0.05
    step = resolution / split
    fine = np.kron(free, np.ones((split, split), bool))
    to_solid, to_free = (ndimage.distance_transform_edt(part) * step for part in (fine, ~fine))
    # Between middles of small squares, so too large by half of one.
    stops = (~fine, to_solid < resolution + step / 2, to_free > resolution + step / 2)
    heading = poses[:, 2:] + angles
    ahead = np.arange(0, plain.REACH, step)
    place = poses[:, :2] + plain.AHEAD * np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], 1)
    column, row = (
        np.clip(((start[:, None, None] + turn[..., None] * ahead - edge) / step).astype(int), 0, most - 1)
        for start, turn, edge, most in zip(
            place.T, (np.cos(heading), np.sin(heading)), corner, fine.shape[::-1], strict=True
        )
    )  # fmt: skip
    met = [stop[row, column] for stop in stops]
    return *(np.where(m.any(-1), ahead[m.argmax(-1)], plain.REACH) for m in met), step
