"""The loop as a node of ROS 1: scans, odometry and a joystick in, commands out.

`rospy` and the messages come with a ROS installation. The standard messages of cars,
`ackermann_msgs`, are used where they are installed, and made of their text where they are not.
"""

# They come with ROS, and no checker of types finds them.
# pyright: reportMissingImports=false

from __future__ import annotations

import time
from typing import Any, Callable, Mapping, Tuple

from hprs.deploy.loop import STOPPED, ControlLoop, Drive, pace, run
from hprs.deploy.scan import Scan
from hprs.errors import UsageError

SCAN, ODOMETRY, DRIVE, JOY, SIGNALS = "/scan", "/odom", "/drive", "/joy", "/hprs/signals/"
"""Topics; a signal that localisation knows is heard as std_msgs/Float64 below the last one."""
NODE = "hprs_drive"

_ACKERMANN = {
    "ackermann_msgs/AckermannDrive": (
        "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\n"
        "float32 acceleration\nfloat32 jerk\n"
    ),
    "ackermann_msgs/AckermannDriveStamped": (
        "std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n"
    ),
}
"""Texts of the messages; a message's checksum is made of them, so that others understand it."""
_HEADER = "uint32 seq\ntime stamp\nstring frame_id\n"


def ackermann_stamped() -> Tuple[Any, Any]:
    """The classes of AckermannDriveStamped and AckermannDrive.

    Raises:
        UsageError: There is no ROS 1 here.
    """
    try:
        import genpy.dynamic
    except ImportError:
        raise UsageError(
            "there is no ROS 1 here. Source its setup file first, as in: "
            "source /opt/ros/noetic/setup.bash"
        ) from None
    try:
        from ackermann_msgs.msg import AckermannDrive, AckermannDriveStamped
    except ImportError:
        line = "=" * 80
        stamped, plain = "ackermann_msgs/AckermannDriveStamped", "ackermann_msgs/AckermannDrive"
        text = _ACKERMANN[stamped]
        for name, content in (("std_msgs/Header", _HEADER), (plain, _ACKERMANN[plain])):
            text += "{}\nMSG: {}\n{}".format(line, name, content)
        made: Mapping[str, Any] = genpy.dynamic.generate_dynamic(stamped, text)
        return made[stamped], made[plain]
    return AckermannDriveStamped, AckermannDrive


def drive_ros1(loop: ControlLoop, dead_man_button: int, tell: Callable[[str], None]) -> None:
    """Drive until the node is shut down.

    Args:
        loop: The loop.
        dead_man_button: Number of the joystick's button.
        tell: Takes a line whenever the phase or its reason changes.

    Raises:
        UsageError: There is no ROS 1 here.
    """
    stamped, _ = ackermann_stamped()
    import rospy
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import Joy, LaserScan
    from std_msgs.msg import Float64

    rospy.init_node(NODE, disable_signals=True)
    publisher = rospy.Publisher(DRIVE, stamped, queue_size=1)
    # Only the newest message counts, and small ones must not wait for more.
    newest = {"queue_size": 1, "tcp_nodelay": True}
    rospy.Subscriber(SCAN, LaserScan, lambda message: loop.hear_scan(_scan(message)), **newest)
    rospy.Subscriber(
        ODOMETRY, Odometry, lambda message: loop.hear_speed(message.twist.twist.linear.x), **newest
    )

    def joystick(message: Any) -> None:
        buttons = message.buttons
        loop.hear_dead_man(0 <= dead_man_button < len(buttons) and bool(buttons[dead_man_button]))

    rospy.Subscriber(JOY, Joy, joystick, **newest)
    for name in loop.monitor.signals:

        def hear(message: Any, name: str = name) -> None:
            loop.hear_signals({name: message.data})

        rospy.Subscriber(SIGNALS + name, Float64, hear, **newest)
    last = ["", ""]

    def publish(drive: Drive) -> None:
        message = stamped()
        message.header.stamp = rospy.Time.now()
        message.drive.speed = drive.speed
        message.drive.steering_angle = drive.steering_angle
        publisher.publish(message)
        if [drive.phase, drive.reason] != last:
            last[:] = [drive.phase, drive.reason]
            tell("{}{}".format(drive.phase, drive.reason and ": " + drive.reason))

    try:
        run(loop, publish, going=lambda: not rospy.is_shutdown())
    finally:
        # However it ends, the car's last word from here is to stand.
        publish(Drive(0.0, 0.0, STOPPED, "the node ends"))
        time.sleep(0.1)
        rospy.signal_shutdown("done")
        found = pace(loop)
        tell(
            "{} ticks, late by {:.1f} ms in the median and {:.1f} ms at most; a decision takes "
            "{:.2f} ms".format(
                found.ticks, 1e3 * found.median, 1e3 * found.most, 1e3 * found.decision
            )
        )


def _scan(message: Any) -> Scan:
    return Scan(
        message.ranges,
        message.angle_min,
        message.angle_increment,
        message.range_min,
        message.range_max,
    )
