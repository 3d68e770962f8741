"""Our simulator as a car that speaks ROS 1; prints what became of the drive, as JSON.

    python ros1_car.py lap       drive one lap
    python ros1_car.py silence   kill what publishes scans in the middle of the lap

Scans of 1,080 beams come 25 times a second from a process of their own, odometry 50 times.
"""

import json
import os
import signal
import subprocess
import sys
import time

# Debian's packages of ROS are no part of the virtual environment, and must not hide its NumPy.
sys.path.append("/usr/lib/python3/dist-packages")

RAW_SCAN = "/simulated/scan"
BUTTON = 4
STEP = 0.02
LONGEST = 40.0


def relay():
    """Publish the simulator's scans as a lidar's driver does."""
    import rospy
    from sensor_msgs.msg import LaserScan

    rospy.init_node("lidar", disable_signals=True)
    publisher = rospy.Publisher("/scan", LaserScan, queue_size=1)
    rospy.Subscriber(RAW_SCAN, LaserScan, publisher.publish, queue_size=1, tcp_nodelay=True)
    rospy.spin()


class Car:
    """The simulator's car in steps of 0.02 s."""

    def __init__(self):
        import jax
        import jax.numpy as jnp

        from hprs.carsim import race
        from hprs.carsim import track as tracks
        from hprs.carsim.actuators import Command
        from hprs.carsim.collision import touches_wall
        from tests.deploy.simulated_car import SimulatedCar

        self.made = SimulatedCar("gm")
        track, world = self.made.track, self.made.world
        parameters = jax.tree.map(lambda leaf: leaf[0], world.parameters)

        def step(car, place, steering, speed):
            for _ in range(round(STEP / race.TIME_STEP)):
                car = race._moved(car, Command(steering, speed), parameters)
            now = tracks.progress(track, car.position, place)
            moved = tracks.advance(track, place, now)
            return car, now, moved / track.length, touches_wall(track, car)

        self.step, self.number = jax.jit(step), jnp.float32
        self.car, self.place = self.made.car, world.progress[0]
        self.progress, self.contact = 0.0, False

    def advance(self, speed, angle):
        d = self.made.driving
        steering, command = self.number(angle / d.steering_angle), self.number(speed / d.speed_gain)
        self.car, self.place, moved, contact = self.step(self.car, self.place, steering, command)
        self.progress += float(moved)
        self.contact |= bool(contact)

    def scan(self):
        from dataclasses import replace

        import jax

        cars = jax.tree.map(lambda leaf: leaf[None], self.car)
        self.made.world = replace(self.made.world, cars=cars)
        return self.made.scan()


def message_of(scan):
    import rospy
    from sensor_msgs.msg import LaserScan

    message = LaserScan()
    message.header.stamp = rospy.Time.now()
    message.angle_min, message.angle_increment = scan.angle_min, scan.angle_increment
    message.angle_max = -scan.angle_min
    message.range_min, message.range_max = scan.range_min, scan.range_max
    message.ranges = scan.ranges.tolist()
    return message


def drive(kind):
    import rospy
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import Joy, LaserScan
    from std_msgs.msg import Float64

    from hprs.deploy.ros1 import ackermann_stamped

    car = Car()
    car.advance(0.0, 0.0)
    car.scan()
    rospy.init_node("car", disable_signals=True)
    told = [(time.monotonic(), 0.0, 0.0)]

    def hear(message):
        told.append((time.monotonic(), message.drive.speed, message.drive.steering_angle))

    rospy.Subscriber("/drive", ackermann_stamped()[0], hear, tcp_nodelay=True)
    publishers = {
        name: rospy.Publisher(topic, kind_, queue_size=1, tcp_nodelay=True)
        for name, topic, kind_ in (
            ("scan", RAW_SCAN, LaserScan),
            ("odometry", "/odom", Odometry),
            ("joy", "/joy", Joy),
            ("progress", "/hprs/signals/progress", Float64),
            ("collision", "/hprs/signals/collision", Float64),
        )
    }
    lidar = subprocess.Popen([sys.executable, __file__, "relay"])
    killed = stopped = None
    start = due = time.monotonic()
    number = 0
    try:
        while time.monotonic() - start < LONGEST and not car.contact and car.progress < 1:
            _, speed, angle = told[-1]
            car.advance(speed, angle)
            odometry = Odometry()
            odometry.twist.twist.linear.x = float(car.car.speed)
            publishers["odometry"].publish(odometry)
            publishers["joy"].publish(Joy(buttons=[0] * BUTTON + [1]))
            publishers["progress"].publish(Float64(car.progress))
            publishers["collision"].publish(Float64(float(car.contact)))
            if number % 2 == 0:
                publishers["scan"].publish(message_of(car.scan()))
            number += 1
            if kind == "silence" and killed is None and car.progress > 0.4:
                assert speed > 1.0
                os.kill(lidar.pid, signal.SIGKILL)
                killed = time.monotonic()
            if killed is not None and stopped is None:
                zeros = [then for then, asked, _ in told if then > killed and asked == 0.0]
                stopped = zeros[0] - killed if zeros else None
            if killed is not None and time.monotonic() - killed > 1.5:
                break
            due += STEP
            time.sleep(max(0.0, due - time.monotonic()))
    finally:
        lidar.kill()
        lidar.wait()
    found = {
        "progress": car.progress,
        "contact": car.contact,
        "seconds": time.monotonic() - start,
        "stopped_after": stopped,
        "moved_on": any(then > killed + 0.5 and asked for then, asked, _ in told)
        if killed
        else None,
        "speed": float(car.car.speed),
    }
    print("RESULT " + json.dumps(found), flush=True)


if __name__ == "__main__":
    relay() if sys.argv[1] == "relay" else drive(sys.argv[1])
