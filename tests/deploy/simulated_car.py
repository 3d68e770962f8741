"""Our simulator as a car: scans of 1,080 beams and odometry out, commands in."""

import math
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from hprs.carsim import race
from hprs.carsim.actuators import Command
from hprs.carsim.lidar import Lidar, measure
from hprs.carsim.selection import selected
from hprs.deploy import load_bundle
from hprs.deploy.driving import Driving
from hprs.deploy.scan import Scan
from hprs.envs.driving.description import action_details, observation_details
from hprs.envs.functional import make
from hprs.training.description import Details, described

BUNDLE = Path(__file__).parents[2] / "results/ppo/safedriving/hprs-paper-seed-0.bundle"
BEAMS = 1080


def trained_bundle():
    """A committed policy, with the details that are younger than it."""
    simulation = make("hprs/SafeDriving-v0", tracks="gm")
    details = Details(observation_details(simulation), action_details())
    return described(load_bundle(BUNDLE), details)


class SimulatedCar:
    """One car on one track, without noise."""

    def __init__(self, track="gm", seed=0, beams=BEAMS, **options):
        found = make("hprs/SafeDriving-v0", tracks=track, randomisation="nominal", **options)
        self.simulation, self.track = found, selected(found.tracks, 0)
        self.driving = Driving.of(trained_bundle())
        lidar = Lidar(beams=beams)
        self._see = jax.jit(lambda car: measure(self.track, car, lidar=lidar))
        self._step = jax.jit(
            lambda world, steering, speed: race.step(
                world, self.track, Command(steering, speed), lidar=found.settings.lidar
            )
        )
        self._clearance = jax.jit(lambda world: race.clearance(world, self.track)[0])
        self.world = race.reset(jax.random.key(seed), self.track, found.settings)

    @property
    def car(self):
        return jax.tree.map(lambda leaf: leaf[0], self.world.cars)

    def scan(self):
        """As ROS has it: from the right to the left."""
        ranges = np.asarray(self._see(self.car), np.float64)[::-1]
        increment = math.radians(270) / (len(ranges) - 1)
        return Scan(ranges, -math.radians(135), increment, 0.06, 30.0)

    @property
    def speed(self):
        return float(self.world.velocity)

    @property
    def progress(self):
        return float(self.world.distance[0] / self.track.length)

    def truth(self):
        """What localisation and a bumper would say."""
        return {
            "progress": self.progress,
            "collision": float(self.world.hit_wall[0]),
            "clearance": float(self._clearance(self.world)),
        }

    def obey(self, drive):
        """Drive for 0.1 s."""
        d = self.driving
        steering, speed = drive.steering_angle / d.steering_angle, drive.speed / d.speed_gain
        self.world = self._step(self.world, jnp.float32(steering), jnp.float32(speed))


class FakeClock:
    """Time passes where it is told to."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now

    def sleep(self, seconds):
        self.now += seconds
