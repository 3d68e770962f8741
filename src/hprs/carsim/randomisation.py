"""Domain randomisation: which physical quantities vary from world to world, and how far.

`QUANTITIES` is the one table. The paper says that mass, sensor noise and actuator gains are
randomised; its code varied gravity in the place of mass, and varied its quantities in evaluation
too. What it did not vary is an addition here, for policies that are to drive a real car.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import partial
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from hprs.carsim.actuators import MAX_DELAY, MAX_SPEED_COMMAND, ActuatorParameters
from hprs.carsim.vehicle import VehicleParameters
from hprs.errors import UsageError, did_you_mean

RangesName = Literal["all", "released", "released-gm", "nominal"]


@partial(
    jax.tree_util.register_dataclass,
    data_fields=["lidar_noise", "velocity_noise", "velocity_floor"],
    meta_fields=[],
)
@dataclass(frozen=True)
class SensorParameters:
    """How far sensors are off."""

    lidar_noise: Array | float = 0.03
    """A reading is multiplied by a uniform number in 1 +- this."""
    velocity_noise: Array | float = 0.01
    """Standard deviation over velocity."""
    velocity_floor: Array | float = 0.01
    """Standard deviation at standstill, m/s."""


@partial(
    jax.tree_util.register_dataclass, data_fields=["start_offset", "start_heading"], meta_fields=[]
)
@dataclass(frozen=True)
class StartParameters:
    """How far a random start is from the centre line's own pose; where along it is always drawn."""

    start_offset: Array | float = 0.0
    """To the left, over the room that leaves a normalised wall distance of 0.5."""
    start_heading: Array | float = 0.0
    """From the direction of the centre line, rad."""


@partial(
    jax.tree_util.register_dataclass,
    data_fields=["vehicle", "actuators", "sensors", "start"],
    meta_fields=[],
)
@dataclass(frozen=True)
class Parameters:
    """Everything about one car that randomisation may change."""

    vehicle: VehicleParameters = field(default_factory=VehicleParameters)
    actuators: ActuatorParameters = field(default_factory=ActuatorParameters)
    sensors: SensorParameters = field(default_factory=SensorParameters)
    start: StartParameters = field(default_factory=StartParameters)


@dataclass(frozen=True)
class Quantity:
    """A row of the table: a quantity that is drawn uniformly."""

    name: str
    unit: str
    nominal: float
    low: float
    high: float
    source: str
    gm: tuple[float, float] | None = None
    """The range on the track GM where the paper's code has another one."""
    released: bool = False
    """Whether the paper's code varies it."""
    chosen: tuple[float, ...] = ()
    """Values to test a policy under, where half an end of the range beyond it makes no sense."""

    @property
    def tested(self) -> tuple[float, ...]:
        """Values under which a policy is tested, ascending: in the range and beyond both ends."""
        if self.chosen:
            return self.chosen
        below = [self.low - share * abs(self.low) for share in _BEYOND[::-1]]
        above = [self.high + share * abs(self.high) for share in _BEYOND]
        within = [self.low, (self.low + self.high) / 2, self.high]
        return tuple(sorted({round(value, 6) for value in (*below, *within, *above)}))


_BEYOND = (0.25, 0.5)
"""How far beyond its range a quantity is tested, over the range's end."""
_CODE = "the paper's code"
_ADDED = "added"

# fmt: off
QUANTITIES = (
    Quantity("gravity", "m/s^2", 9.81, 9.81, 15.0, _CODE, gm=(9.81, 12.0), released=True),
    Quantity("wheel_speed", "rad/s per m/s", 22.0, 20.0, 25.0, _CODE, released=True),
    Quantity("top_speed", "m/s", 3.5, 3.5, 4.0, _CODE, gm=(3.5, 3.75), released=True),
    Quantity("steering_gain", "1", 0.5, 0.5, 0.75, _CODE, gm=(0.6, 0.75), released=True),
    Quantity("velocity_noise", "1", 0.01, 0.01, 0.05, _CODE, released=True),
    # Further out a car that is turned as well would begin its episode in the wall.
    Quantity(
        "start_offset", "1", 0.0, -1.0, 1.0, _CODE, released=True,
        chosen=(-1.25, -1.0, -0.5, 0.0, 0.5, 1.0, 1.25),
    ),
    Quantity(
        "start_heading", "rad", 0.0, -0.2, 0.2,
        "the paper's code: towards a random place 2.5 to 5 % of a lap ahead", released=True,
    ),
    Quantity("mass", "kg", 3.74, 3.0, 4.4, f"{_ADDED}; the paper's car weighs 4.36 kg"),
    Quantity("friction", "1", 1.0489, 0.8, 1.1, f"{_ADDED}; 0.8 in the paper's code"),
    Quantity("motor_time", "s", 0.1, 0.05, 0.2, _ADDED),
    Quantity("steering_time", "s", 0.05, 0.03, 0.1, _ADDED),
    Quantity("steering_offset", "rad", 0.0, -0.02, 0.02, f"{_ADDED}; trim of the servo"),
    # Tested up to 200 ms.
    Quantity(
        "delay", "simulation steps of 0.01 s", 0.0, 0.0, 5.0, f"{_ADDED}; computer and bus",
        chosen=tuple(map(float, range(21))),
    ),
    Quantity("lidar_noise", "1", 0.03, 0.0, 0.03, f"{_ADDED}; always 0.03 in the paper's code"),
)
# fmt: on
"""What varies. Nominal values are those of the parameters' defaults; a test compares them."""

_NAMES = tuple(quantity.name for quantity in QUANTITIES)
_WHEEL_RADIUS = 0.05
"""m; of the paper's car, whose speed command becomes an angular velocity of the wheels."""


@partial(jax.tree_util.register_dataclass, data_fields=["low", "high"], meta_fields=[])
@dataclass(frozen=True)
class Ranges:
    """Ranges of the table's quantities, in its order."""

    low: Array | np.ndarray
    """(Q,)"""
    high: Array | np.ndarray
    """(Q,)"""


def ranges(name: RangesName = "all") -> Ranges:
    """Ranges by name.

    Args:
        name: `all`, the whole table; `released`, what the paper's code varied (`released-gm` on
            the track GM); `nominal`, nothing: what that code did on the track TRT.
    """
    known = ("all", "released", "released-gm", "nominal")
    if name not in known:
        raise UsageError(
            f"There are no ranges '{name}'; there are {', '.join(known)}."
            f"{did_you_mean(name, known)}"
        )
    pairs = [_range(quantity, name) for quantity in QUANTITIES]
    low, high = np.array(pairs, np.float32).T
    return Ranges(low, high)


def narrowed(within: Ranges, changes: Mapping[str, tuple[float, float]]) -> Ranges:
    """Ranges with other ones for some quantities.

    Args:
        within: The ranges of all others.
        changes: Name of a quantity to its range; twice the same number for a fixed value.

    Raises:
        UsageError: There is no such quantity, or its range is none.
    """
    low, high = np.array(within.low, np.float32), np.array(within.high, np.float32)
    for name, (least, greatest) in changes.items():
        if name not in _NAMES:
            raise UsageError(
                f"There is no randomised quantity '{name}'.{did_you_mean(name, _NAMES)} "
                f"There are {', '.join(_NAMES)}."
            )
        _check(QUANTITIES[_NAMES.index(name)], least, greatest)
        low[_NAMES.index(name)], high[_NAMES.index(name)] = least, greatest
    return Ranges(low, high)


def _check(quantity: Quantity, least: float, greatest: float) -> None:
    """See that a range is one, and that no end of it is impossible."""
    shown = f"{quantity.name} got [{least:g}, {greatest:g}]"
    if not -np.inf < least <= greatest < np.inf:
        raise UsageError(f"{shown}: a range is two numbers, the smaller one first.")
    if quantity.low >= 0 and (least < 0 or (least == 0 < quantity.low)):
        word = "above 0" if quantity.low > 0 else "at least 0"
        raise UsageError(f"{shown}, but is {word} on every car.")
    if quantity.name == "delay" and greatest > MAX_DELAY:
        raise UsageError(f"{shown}, but at most {MAX_DELAY} simulation steps are remembered.")


def _range(quantity: Quantity, name: RangesName) -> tuple[float, float]:
    if name == "nominal" or (name != "all" and not quantity.released):
        return quantity.nominal, quantity.nominal
    if name == "released-gm" and quantity.gm:
        return quantity.gm
    return quantity.low, quantity.high


def sample(key: Array, within: Ranges) -> Parameters:
    """Parameters of one car, drawn uniformly.

    Args:
        key: JAX key.
        within: From `ranges`.
    """
    low, high = jnp.asarray(within.low), jnp.asarray(within.high)
    return _parameters(low + (high - low) * jax.random.uniform(key, low.shape, low.dtype))


def nominal(dtype: jnp.dtype | type = jnp.float32) -> Parameters:
    """Parameters that vary nowhere."""
    return _parameters(jnp.array([quantity.nominal for quantity in QUANTITIES], dtype))


def _parameters(values: Array) -> Parameters:
    drawn = dict(zip(_NAMES, values, strict=True))
    wheel_speed, top_speed = drawn.pop("wheel_speed"), drawn.pop("top_speed")
    # `top_speed` stretches the speed command.
    drawn["speed_gain"] = wheel_speed * _WHEEL_RADIUS * top_speed / MAX_SPEED_COMMAND
    drawn["delay"] = jnp.round(drawn["delay"]).astype(jnp.int32)
    return Parameters(
        vehicle=_filled(VehicleParameters, drawn, values.dtype),
        actuators=_filled(ActuatorParameters, drawn, values.dtype),
        sensors=_filled(SensorParameters, drawn, values.dtype),
        start=_filled(StartParameters, drawn, values.dtype),
    )


def _filled(kind: type, drawn: dict[str, Array], dtype: jnp.dtype):
    """Parameters of a kind: what was drawn, and the defaults as arrays of the same type."""
    return kind(
        **{
            entry.name: drawn.get(entry.name, jnp.asarray(entry.default, dtype))
            for entry in fields(kind)
        }
    )
