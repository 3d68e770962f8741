"""Lidar scans and contact checks a second, for numbers of cars, beams and sizes of maps.

    .venv/bin/python benchmarks/carsim.py

One line is one track and one number of beams; its columns are numbers of cars in one jitted call.
Rates are per second of processor time, of one core, and so hold on a busy machine too. In brackets:
times the steps a second of Gymnasium's lander on one core, measured in the same run.
Costs are linear in the cars, and do not grow with the map: only with the walls that one cell sees.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import time
from collections.abc import Callable
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from _common import best_of, lander, lander_step
from _flower import flower

from hprs.carsim.collision import touches_car, touches_wall
from hprs.carsim.designs import load_track
from hprs.carsim.lidar import Lidar, measure
from hprs.carsim.track import Track, pose_at
from hprs.carsim.vehicle import Car, at_rest

CARS = (1, 16, 256, 1_024, 4_096, 16_384)
BEAMS = (64, 1_080)
MOST_READINGS = 2**22
"""In one call: a scan of more is left out."""


def cars_on(track: Track, number: int, key: int = 0) -> Car:
    """Cars anywhere along the centre line, in any direction."""
    place, turn = jax.random.uniform(jax.random.key(key), (2, number))
    x, y, yaw = jax.vmap(partial(pose_at, track))(place * track.length).T
    return at_rest(x, y, yaw + 2 * np.pi * turn)


def processor_time(function: Callable[[], object]) -> float:
    """Seconds of processor time of one call, the smallest of several measurements."""
    function()
    start = time.perf_counter()
    function()
    calls = max(1, int(0.01 / (time.perf_counter() - start)))

    def once() -> float:
        start = time.process_time()
        for _ in range(calls):
            function()
        return (time.process_time() - start) / calls

    return best_of(once, 10)


def row(label: str, check: Callable, track: Track, step: float, readings: int = 1) -> None:
    """Print how often a second a function of a track and a car runs, for all numbers of cars."""
    run = jax.jit(jax.vmap(check, (None, 0)))
    cells = []
    for number in CARS:
        if number * readings > MOST_READINGS:
            continue
        cars = cars_on(track, number)
        rate = number / processor_time(lambda cars=cars: jax.block_until_ready(run(track, cars)))
        cells.append(f"{rate:9.3g} ({rate * step:6.3g}x)")
    print(f"{label:24s}", *cells, flush=True)


def touches_shifted(_: Track, car: Car) -> jax.Array:
    """Contact with a car somewhere else."""
    return touches_car(car, at_rest(car.y, car.x, jnp.sin(car.yaw)))


def lander_seconds() -> float:
    """Processor time of a lander's step."""
    env, start = lander(), time.process_time()
    lander_step(env, 5_000)
    return (time.process_time() - start) / 5_000


def measure_all() -> None:
    """Print the tables."""
    step = min(lander_seconds() for _ in range(5))
    print(f"lander: {1 / step:,.0f} steps/s")
    maps = {name: load_track(name) for name in ("gm", "trt", "gm-c")}
    maps |= {f"flower {radius}": flower(radius) for radius in (12, 30)}
    print(f"{'cars':24s}", *(f"{number:19,d}" for number in CARS))
    for name, track in maps.items():
        cells, _, seen = track.visible.shape
        print(
            f"{name}: {float(track.length):.0f} m, {track.walls.shape[0]} walls, {cells} "
            f"cells, at most {seen} walls seen and {track.near.shape[2]} near from one"
        )
        for beams in BEAMS:
            scan = partial(measure, lidar=Lidar(beams=beams))
            row(f"  scans, {beams} beams", scan, track, step, beams)
        row("  contact with walls", touches_wall, track, step)
    row("contact of two cars", touches_shifted, maps["gm"], step)


measure_all()
