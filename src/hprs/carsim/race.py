"""One world: one car, or one behind a leader, on a track.

A control step is ten simulation steps of 0.01 s, each with a test for contact, and one lidar scan:
10 Hz. The functions are of one world; `jax.vmap` makes a batch, in which every world may have its
own track. The car that takes commands is car 0; car 1 drives itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from hprs.carsim import track as tracks
from hprs.carsim.actuators import (
    STEPS_PER_COMMAND,
    Command,
    DelayLine,
    actuate,
    idle,
    in_force,
    pushed,
)
from hprs.carsim.collision import touches_car, touches_wall
from hprs.carsim.faults import Faults, faulty_scan, faulty_speed
from hprs.carsim.leader import GAP_THRESHOLD, LeaderParameters, follow_the_gap, sample_leader
from hprs.carsim.lidar import BEAMS, LIDAR, Lidar, beam_angles, measure, with_noise
from hprs.carsim.randomisation import Parameters, Ranges, ranges, sample
from hprs.carsim.track import Track
from hprs.carsim.vehicle import TIME_STEP, Car, advance, at_rest

Tree = TypeVar("Tree")

CONTROL_STEP = STEPS_PER_COMMAND * TIME_STEP
"""Time between two commands in s."""
GRID = {1: ((0.0, 0.0),), 2: ((1.0, -0.2), (2.0, 0.2))}
"""Number of cars to their places at a `grid` start: progress and offset to the left in m."""
CLEAR_START = 0.5
"""Least normalised wall distance at a random start."""
LEAST_GAP = 1.0
"""Of a random start with a leader, m."""
LARGEST_GAP = 0.2
"""Of a random start with a leader, over the length of a lap."""
_LOST = 2
"""What a step's key is folded with for the draw of a lost scan; 0 and 1 are taken by its split."""


@partial(
    jax.tree_util.register_dataclass,
    data_fields=["ranges", "threshold", "faults"],
    meta_fields=["cars", "start", "lidar"],
)
@dataclass(frozen=True)
class Settings:
    """What a world is like; the number of cars and the start are known when it is compiled."""

    cars: Literal[1, 2] = 1
    """2 for a car and its leader."""
    start: Literal["random", "grid"] = "random"
    """Anywhere on the track, or at the start line."""
    lidar: Lidar = LIDAR
    """Of car 0; a leader has the paper's."""
    ranges: Ranges = field(default_factory=ranges)
    """Of the domain randomisation. The paper's code had it in evaluations too."""
    threshold: Array | float = GAP_THRESHOLD
    """Of the leader's gaps, m."""
    faults: Faults | None = None
    """Of the sensors of car 0; None: no program has anything for them."""


@partial(
    jax.tree_util.register_dataclass,
    data_fields=[
        "cars",
        "lines",
        "progress",
        "distance",
        "gap",
        "hit_wall",
        "hit_car",
        "scan",
        "velocity",
        "leader_command",
        "steps",
        "key",
        "parameters",
        "leader",
    ],
    meta_fields=[],
)
@dataclass(frozen=True)
class World:
    """State of one world with N cars."""

    cars: Car
    """Fields (N,)."""
    lines: DelayLine
    """Commands on their way to the actuators, fields (N, REMEMBERED)."""
    progress: Array
    """Arc length from the start line, (N,), m."""
    distance: Array
    """Driven along the track since the reset, not wrapped, (N,), m."""
    gap: Array
    """From car 0 forwards to the leader along the track at the reset, (), m; 0 without one."""
    hit_wall: Array
    """Whether a car touched a wall, (N,) bool; it stays where it did, with the speed it had."""
    hit_car: Array
    """Whether the cars touched each other, () bool; both stay where they did."""
    scan: Array
    """Lidar readings of car 0, (beams,), m."""
    velocity: Array
    """Measured forward velocity of car 0, (), m/s."""
    leader_command: Command
    """Of car 1 for the next control step; scalars."""
    steps: Array
    """Control steps since the reset, () int32."""
    key: Array
    """Data of the JAX key for what is still to be drawn, (2,) uint32."""
    parameters: Parameters
    """Fields (N,)."""
    leader: LeaderParameters
    """Scalars."""


def reset(key: Array, track: Track, settings: Settings) -> World:
    """A world at the start of an episode.

    Args:
        key: JAX key; it determines all that is drawn in the episode.
        track: One track.
        settings: Of the world.
    """
    dtype = track.centre.dtype
    place_key, parameters_key, leader_key, key = jax.random.split(key, 4)
    within = jax.tree.map(lambda bound: jnp.asarray(bound, dtype), settings.ranges)
    parameters = jax.vmap(sample, (0, None))(
        jax.random.split(parameters_key, settings.cars), within
    )
    cars, progress = _start(place_key, track, parameters, settings)
    leader = jax.tree.map(
        lambda value: value.astype(dtype), sample_leader(leader_key, threshold=settings.threshold)
    )
    none = jnp.zeros(settings.cars, bool)
    zero = jnp.zeros((), dtype)
    world = World(
        cars=cars,
        lines=jax.tree.map(lambda line: jnp.tile(line, (settings.cars, 1)), idle(dtype)),
        progress=progress,
        distance=jnp.zeros(settings.cars, dtype),
        gap=jnp.mod(progress[-1] - progress[0], track.length),
        hit_wall=none,
        hit_car=jnp.zeros((), bool),
        scan=jnp.zeros(settings.lidar.beams, dtype),
        velocity=zero,
        leader_command=Command(zero, zero),
        steps=jnp.zeros((), jnp.int32),
        key=jax.random.key_data(key),
        parameters=parameters,
        leader=leader,
    )
    noise, key = _noise(world)
    world = replace(_sensed(world, track, noise, settings.lidar), key=key)
    if settings.faults is None:
        return world
    return replace(world, velocity=faulty_speed(world.velocity, settings.faults))


def step(
    world: World,
    track: Track,
    command: Command,
    *,
    lidar: Lidar = LIDAR,
    faults: Faults | None = None,
) -> World:
    """The world one control step later.

    Args:
        world: The state.
        track: The track that it was reset on.
        command: For car 0; scalars.
        lidar: Of the settings that it was reset with.
        faults: Of these settings.
    """
    before = world
    # Before the loop: XLA draws again wherever a drawn number is used inside of one.
    noise, key = _noise(world)
    lines = _all_pushed(world, command)
    cars, hit_wall, hit_car = _driven(world, lines, track)
    progress = jax.vmap(partial(tracks.progress, track))(cars.position, world.progress)
    moved = tracks.advance(track, world.progress, progress)
    world = replace(
        world,
        cars=cars,
        lines=lines,
        progress=progress,
        distance=world.distance + moved,
        hit_wall=hit_wall,
        hit_car=hit_car,
        steps=world.steps + 1,
        key=key,
    )
    world = _sensed(world, track, noise, lidar)
    return world if faults is None else _arrived(world, before, faults)


def _arrived(world: World, before: World, faults: Faults) -> World:
    """The world with the readings that arrive, of those that were measured."""
    # A key of its own, so that noise is drawn as without faults.
    key = jax.random.fold_in(jax.random.wrap_key_data(before.key), _LOST)
    uniform = jax.random.uniform(key, (), world.progress.dtype)
    return replace(
        world,
        scan=faulty_scan(world.scan, before.scan, uniform=uniform, faults=faults),
        velocity=faulty_speed(world.velocity, faults),
    )


def clearance(world: World, track: Track) -> Array:
    """Normalised wall distance of every car's centre, (N,)."""
    return jax.vmap(partial(tracks.clearance, track))(world.cars.position)


def lead_distance(world: World) -> Array:
    """Car 0's place on the track minus the leader's, (), m; negative behind it, as in the paper."""
    return world.distance[0] - world.distance[-1] - world.gap


def _all_pushed(world: World, command: Command) -> DelayLine:
    cars = world.progress.shape[0]
    given = [command, world.leader_command][:cars]
    together = jax.tree.map(lambda *values: jnp.stack(values), *given)
    return jax.vmap(pushed)(world.lines, together)


def _driven(world: World, lines: DelayLine, track: Track) -> tuple[Car, Array, Array]:
    """Cars, contacts with walls and contact with each other after ten simulation steps."""
    p = world.parameters
    delayed = jax.vmap(lambda line, at, delay: in_force(line, at, delay=delay), (0, None, 0))
    commands = jax.vmap(delayed, (None, 0, None))(
        lines, jnp.arange(STEPS_PER_COMMAND), p.actuators.delay
    )

    def simulated(
        carry: tuple[Car, Array, Array], command: Command
    ) -> tuple[tuple[Car, Array, Array], None]:
        cars, hit_wall, hit_car = carry
        moved = jax.vmap(_moved)(cars, command, p)
        # The episode of car 0 ends at its first contact, so that nothing moves any more.
        stands = hit_wall | hit_wall[0] | hit_car
        cars = jax.tree.map(lambda old, new: jnp.where(stands, old, new), cars, moved)
        hit_wall |= jax.vmap(partial(touches_wall, track))(cars)
        if cars.x.shape[0] == 2:
            hit_car |= touches_car(_one(cars, 0), _one(cars, 1))
        return (cars, hit_wall, hit_car), None

    start = (world.cars, world.hit_wall, world.hit_car)
    return jax.lax.scan(simulated, start, commands)[0]


def _moved(car: Car, command: Command, p: Parameters) -> Car:
    inputs = actuate(car, command, mass=p.vehicle.mass, parameters=p.actuators)
    return advance(car, *inputs, parameters=p.vehicle)


def _noise(world: World) -> tuple[tuple[Array, Array], Array]:
    """Uniform numbers in (-1, 1) for all beams, a normal one for velocity; and the next key."""
    draw, key = jax.random.split(jax.random.wrap_key_data(world.key))
    dtype, cars = world.progress.dtype, world.progress.shape[0]
    above = np.nextafter(np.array(-1.0, dtype), np.array(0.0, dtype))
    # One draw for both: for one world, the number of operations is what costs.
    beams = world.scan.shape[0] + (cars - 1) * BEAMS
    uniform = jax.random.uniform(draw, (beams + 1,), dtype, minval=above, maxval=1.0)
    normal = math.sqrt(2) * jax.lax.erf_inv(uniform[-1])
    return (uniform[:-1], normal), jax.random.key_data(key)


def _sensed(world: World, track: Track, noise: tuple[Array, Array], lidar: Lidar) -> World:
    """The world with new readings, and with what the leader makes of its own."""
    number = world.progress.shape[0]
    cars = [_one(world.cars, i) for i in range(number)]
    sensors = [_one(world.parameters.sensors, i) for i in range(number)]
    uniform, normal = noise
    lidars = [lidar, LIDAR][:number]
    parts = jnp.split(uniform, [lidar.beams])
    scans = []
    for i, car in enumerate(cars):
        exact = measure(track, car, cars[1 - i] if number == 2 else None, lidar=lidars[i])
        share = sensors[i].lidar_noise
        scans.append(with_noise(exact, parts[i], share=share, reach=lidars[i].reach))
    forward = cars[0].speed * jnp.cos(cars[0].slip)
    spread = jnp.abs(forward) * sensors[0].velocity_noise + sensors[0].velocity_floor
    world = replace(world, scan=scans[0], velocity=forward + spread * normal)
    if number == 2:
        angles = jnp.asarray(beam_angles(), world.scan.dtype)
        command = follow_the_gap(scans[1], angles, parameters=world.leader)
        world = replace(world, leader_command=command)
    return world


def _one(tree: Tree, index: int) -> Tree:
    """What belongs to one car."""
    return jax.tree.map(lambda leaf: leaf[index], tree)


def _start(
    key: Array, track: Track, parameters: Parameters, settings: Settings
) -> tuple[Car, Array]:
    """Cars at rest and their progress, (N,) m."""
    dtype = track.centre.dtype
    if settings.start == "grid":
        places, offsets = jnp.asarray(GRID[settings.cars], dtype).T
        headings = jnp.zeros(settings.cars, dtype)
    else:
        along, apart = jax.random.uniform(key, (2,), dtype)
        gap = LEAST_GAP + apart * jnp.maximum(0.0, LARGEST_GAP * track.length - LEAST_GAP)
        places = jnp.mod(along * track.length + gap * jnp.arange(settings.cars), track.length)
        share = jnp.asarray(parameters.start.start_offset)
        offsets = jax.vmap(partial(_offset, track))(places, share)
        headings = jnp.asarray(parameters.start.start_heading)
    poses = jax.vmap(partial(tracks.pose_at, track))(places, offsets)
    cars = jax.vmap(at_rest)(poses[:, 0], poses[:, 1], poses[:, 2] + headings)
    return cars, jax.vmap(partial(tracks.progress, track))(cars.position, places)


def _offset(track: Track, place: Array, share: Array) -> Array:
    """Offset to the left in m at a progress: a share in [-1, 1] of the room that is clear."""
    index = jnp.round(place / track.length * tracks.POINTS).astype(jnp.int32) % tracks.POINTS
    room = jnp.stack([track.left[index], track.right[index]]) - CLEAR_START * track.max_clearance
    room = jnp.maximum(room, 0.0)
    return jnp.where(share > 0, share * room[0], share * room[1])
