import json

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

TASK = """signal v in [0, 5] "m/s"
signal steering = action[0] in [-1, 1]
signal before = last_action[0] in [-1, 1]
signal scan[3] in [0, 9] "m"
ensure clear: min(scan) >= 1
achieve there: v >= 3
encourage straight: abs(steering) <= 0.25
encourage smooth: abs(steering - before) <= 0.25
"""
COLUMNS = (
    "v=/odom.twist.twist.linear.x",
    "steering=/cmd.angular.z",
    "before=/cmd.angular.z",
    "scan=/scan.ranges",
)
OPTIONS = [part for column in COLUMNS for part in ("--column", column)]
SECOND = 10**9


class Messages:
    """Makes messages of a few types, for ROS 1 or ROS 2."""

    def __init__(self, version):
        self.version = version
        self.store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)

    def make(self, name, **fields):
        return self.store.types[name](**fields)

    def vector(self, x=0.0, z=0.0):
        return self.make("geometry_msgs/msg/Vector3", x=x, y=0.0, z=z)

    def twist(self, v=0.0, steering=0.0):
        return self.make(
            "geometry_msgs/msg/Twist", linear=self.vector(x=v), angular=self.vector(z=steering)
        )

    def header(self):
        stamp = self.make("builtin_interfaces/msg/Time", sec=0, nanosec=0)
        sequence = {"seq": 0} if self.version == 1 else {}
        return self.make("std_msgs/msg/Header", **sequence, stamp=stamp, frame_id="")

    def odometry(self, v):
        make, none = self.make, np.zeros(36)
        pose = make(
            "geometry_msgs/msg/Pose",
            position=make("geometry_msgs/msg/Point", x=0.0, y=0.0, z=0.0),
            orientation=make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
        )
        return make(
            "nav_msgs/msg/Odometry",
            header=self.header(),
            child_frame_id="",
            pose=make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=none),
            twist=make(
                "geometry_msgs/msg/TwistWithCovariance", twist=self.twist(v), covariance=none
            ),
        )

    def scan(self, *ranges):
        ends = dict.fromkeys(
            (
                "angle_min",
                "angle_max",
                "angle_increment",
                "time_increment",
                "scan_time",
                "range_min",
                "range_max",
            ),
            0.0,
        )
        return self.make(
            "sensor_msgs/msg/LaserScan",
            header=self.header(),
            **ends,
            ranges=np.array(ranges, np.float32),
            intensities=np.zeros(0, np.float32),
        )

    def write(self, folder, messages):
        """Writes (seconds, topic, message) to a bag, and gives its path."""
        path = folder / ("drive.bag" if self.version == 1 else "drive")
        with Writer1(path) if self.version == 1 else Writer2(path, version=9) as bag:
            connections = {}
            serialize = self.store.serialize_ros1 if self.version == 1 else self.store.serialize_cdr
            for seconds, topic, message in messages:
                kind = message.__msgtype__
                if topic not in connections:
                    connections[topic] = bag.add_connection(topic, kind, typestore=self.store)
                bag.write(connections[topic], round(seconds * SECOND), serialize(message, kind))
        return path


@pytest.fixture(params=[1, 2], ids=["ros1", "ros2"])
def ros(request):
    return Messages(request.param)


@pytest.fixture
def assess(hprs, here):
    (here / "task.hprs").write_text(TASK)

    def run(path, *options):
        code, out, err = hprs("assess", path.name, "--task", "task.hprs", "--json", *options)
        return code, json.loads(out) if code == 0 else err.removeprefix("hprs: ").strip()

    return run


def drive(ros):
    """Ticks at 1.0, 2.0, ... 5.0 s; what was last heard counts, also at the very same moment."""
    return [
        (0.5, "/scan", ros.scan(2, 2, 2)),
        (1.0, "/cmd", ros.twist(steering=0.0)),
        (1.5, "/odom", ros.odometry(1.0)),
        (2.0, "/cmd", ros.twist(steering=0.0)),
        (2.5, "/odom", ros.odometry(9.0)),
        (2.75, "/odom", ros.odometry(2.0)),
        (2.8, "/scan", ros.scan(0.1, 2, 2)),
        (2.9, "/scan", ros.scan(1.5, 2, 2)),
        (3.0, "/cmd", ros.twist(steering=1.0)),
        (4.0, "/cmd", ros.twist(steering=1.0)),
        (5.0, "/cmd", ros.twist(steering=0.0)),
        (5.0, "/odom", ros.odometry(3.0)),
        (5.5, "/scan", ros.scan(0.1, 2, 2)),
    ]


def test_states_are_what_was_last_heard_at_the_ticks(assess, here, ros):
    code, found = assess(ros.write(here, drive(ros)), "--ticks", "/cmd", *OPTIONS)
    assert code == 0, found
    # The first tick has no speed, the second no action before the last one: s_0 is at 3 s.
    assert found["steps"] == 2
    assert found["notes"] == [
        "Left out: the first 2 ticks of /cmd, before every signal had a value."
    ]
    # The steering that led to 4 s and 5 s is 1.0 in both, after 0.0 and 1.0.
    assert found["requirements"] == {"clear": True, "there": True, "straight": 0.0, "smooth": 0.5}
    assert (found["pam"], found["outside_ranges"]) == (1.5625, {})


def test_a_topic_that_is_missing_makes_unknown_what_needs_it(assess, here, ros):
    path = ros.write(here, [m for m in drive(ros) if m[1] != "/scan"])
    options = OPTIONS[:-2]
    code, message = assess(path, "--ticks", "/cmd", *options)
    assert (code, message) == (1, (
        f"{path.name} has no messages of '/scan' for signal 'scan'; it has /cmd, /odom. Another column: "
        "--column scan=/TOPIC.FIELD. With --missing unknown the requirements that need it are unknown."
    ))  # fmt: skip
    code, found = assess(path, "--ticks", "/cmd", "--missing", "unknown", *options)
    assert (code, found["pam"], found["safe"], found["target"]) == (0, None, None, True)
    # The first ticks count: what the last action was is unknown in s_1.
    assert found["unknown"] == ["clear", "smooth"]
    assert (found["steps"], "notes" in found) == (4, False)


LATE = """signal d in [0, 9]
signal v in [0, 5]
signal p[2] in [0, 1]
ensure clear: d >= 1
encourage slow: v <= 2 and max(p) <= 1
"""


def test_what_is_not_heard_yet_is_missing_as_an_empty_cell_is(assess, here, ros):
    (here / "late.hprs").write_text(LATE)
    rows = [(0.5, None, None), (2.0, None, None), (2.0, 1.0, (0.0, 1.0)), (2.0, 1.0, (0.0, 1.0))]
    number = {d: ros.make("std_msgs/msg/Float64", data=d) for d in (0.5, 1.0, 2.0)}
    messages = [(i + 1.0, "/d", number[d]) for i, (d, _, _) in enumerate(rows)]
    scan = ros.scan(*rows[-1][2])
    bag = ros.write(here, [*messages, (2.5, "/v", number[1.0]), (2.5, "/scan", scan)])
    cells = [(d, v, *(p or (None, None))) for d, v, p in rows]
    lines = [",".join("" if cell is None else str(cell) for cell in row) for row in cells]
    (here / "log.csv").write_text("\n".join(["d,v,p[0],p[1]", *lines]))
    options = ("--task", "late.hprs", "--missing", "unknown")
    code, expected = assess(here / "log.csv", *options)
    assert (code, expected["safe"], expected["unknown"]) == (0, False, ["slow"])
    bag_options = ("--ticks", "/d", "--column", "p=/scan.ranges")
    code, found = assess(bag, *options, *bag_options)
    assert code == 0, found
    assert {**found, "trace": ""} == {**expected, "trace": ""}
    # Without the ticks at which only the distance was known, the rest is safe.
    code, found = assess(bag, "--task", "late.hprs", *bag_options)
    assert (code, found["safe"], found["steps"]) == (0, True, 1)


def test_a_signal_of_its_own_topic_needs_no_column(assess, here, ros):
    (here / "plain.hprs").write_text("signal v in [0, 5]\nensure slow: v <= 1\n")
    number = [ros.make("std_msgs/msg/Float64", data=float(v)) for v in (0, 1, 2)]
    path = ros.write(here, [(i + 1.0, "/v", message) for i, message in enumerate(number)])
    code, found = assess(path, "--ticks", "/v", "--task", "plain.hprs")
    assert (code, found["safe"], found["steps"]) == (0, False, 2)


def test_mistakes_about_a_bag_are_one_line_each(assess, here):
    ros = Messages(2)
    path = ros.write(here, drive(ros))
    topics = "/cmd (5 messages), /odom (4 messages), /scan (4 messages)"
    ticks = ("--ticks", "/cmd")
    for options, expected, message in [
        ((), 2, f"--ticks names the topic whose messages are the policy's ticks; drive has {topics}."),
        (("--ticks", "/cdm"), 2, f"--ticks: drive has no messages of '/cdm'; it has {topics}. Did you mean '/cmd'?"),
        ((*ticks, *OPTIONS, "--time", "t"), 2, "--time is for tables; a rosbag has time stamps of its own."),
        ((*ticks, *OPTIONS, "--column", "v=/odom"), 2, "--column: '/odom' is no field of a topic's messages, as in v=/odom.twist.twist.linear.x or /scan.ranges[3]."),
        ((*ticks, *OPTIONS, "--column", "v=/odom.twist.twst"), 1, "drive: '/odom.twist.twst' does not exist: there is no 'twst' among twist, covariance. Did you mean 'twist'?"),
        ((*ticks, *OPTIONS, "--column", "v=/odom.twist.twist"), 1, "drive: '/odom.twist.twist' for signal 'v' is a Twist, not a number. It has linear, angular."),
        ((*ticks, *OPTIONS, "--column", "v=/scan.ranges[3]"), 1, "drive: '/scan.ranges[3]' does not exist: no [3]."),
        ((*ticks, *OPTIONS, "--column", "v=/scan.ranges"), 1, "drive: '/scan.ranges' is 3 components, signal 'v' one number."),
        ((*ticks, *OPTIONS, "--column", "scan=/odom.twist.twist.linear.x"), 1, "drive: '/odom.twist.twist.linear.x' is one number, signal 'scan' 3 components."),
    ]:  # fmt: skip
        code, found = assess(path, *options)
        assert (code, found.split(" Another column")[0]) == (expected, message)
    code, found = assess(path, *ticks, *OPTIONS, "--column", "v=/scan.ranges[1]")
    assert code == 0


def test_a_bag_that_cannot_be_assessed_says_why(assess, here):
    ros = Messages(2)
    path = ros.write(
        here, [*drive(ros)[:3], (9.0, "/cmd", ros.twist()), (9.0, "/cmd", ros.twist())]
    )
    options = ("--ticks", "/cmd", *OPTIONS)
    assert assess(path, *options) == (
        1,
        "drive: time stamps must increase, but /cmd has two messages at 9.000000000 s.",
    )
    short = Messages(1)
    path = short.write(here, drive(short)[:-4])
    assert assess(path, *options)[1] == (
        "drive.bag has 1 tick of /cmd with a value of every signal; it needs the initial state and at least one step."
    )
    (here / "bad.bag").write_text("x")
    code, message = assess(here / "bad.bag", *options)
    assert (code, message.startswith("bad.bag cannot be read as a rosbag: ")) == (1, True)
    nan = here / "nan"
    nan.mkdir()
    path = short.write(
        nan,
        [
            (t, topic, short.scan(1, 1, np.nan) if topic == "/scan" else m)
            for t, topic, m in drive(short)
        ],
    )
    path.rename(here / "nan.bag")
    assert (
        assess(here / "nan.bag", *options)[1] == "nan.bag: '/scan.ranges' is NaN at 0.500000000 s."
    )
    code, found = assess(here / "nan.bag", *options, "--missing", "unknown")
    assert (code, found["unknown"]) == (0, ["clear", "smooth"])
    path = Messages(1).write(nan, drive(short)[:3])
    code, message = assess(path.rename(here / "one.bag"), *options, "--missing", "unknown")
    assert message == (
        "one.bag has 1 tick of /cmd; it needs the initial state and at least one step."
    )


def test_there_is_no_such_bag(hprs, here):
    (here / "task.hprs").write_text(TASK)
    code, _, err = hprs("assess", "drive.bag", "--task", "task.hprs", "--ticks", "/cmd")
    assert (code, err) == (2, "hprs: there is no trace file 'drive.bag'.\n")
