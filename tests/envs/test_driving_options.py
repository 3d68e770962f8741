"""Options of the driving benchmarks: one declaration, whichever way an environment is made."""

from __future__ import annotations

import inspect
from dataclasses import fields

import gymnasium as gym
import jax
import numpy as np
import pytest

from hprs.carsim.designs import load_track
from hprs.carsim.randomisation import QUANTITIES, ranges
from hprs.carsim.track import Track, stack_tracks
from hprs.envs import functional
from hprs.envs.driving.options import Options, simulate, track_names
from hprs.envs.follow_leader.env import FollowLeader
from hprs.envs.safe_driving.env import DEFAULTS, SafeDriving
from hprs.errors import UsageError
from hprs.training.environment import check_options

from .driven import FOLLOW, SAFE

WAYS = [gym.make, lambda name, **options: gym.make_vec(name, 2, **options), functional.make]


def same(track: Track, other: Track) -> bool:
    pairs = zip(jax.tree.leaves(track), jax.tree.leaves(other), strict=True)
    return all(np.array_equal(one, another) for one, another in pairs)


@pytest.mark.parametrize("make", WAYS, ids=["make", "make_vec", "functional"])
@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        (SAFE, {"trakcs": "gm"}, "There is no option 'trakcs'. Did you mean 'tracks'?"),
        (
            SAFE,
            {"gap_threshold": 1.0},
            "There is no option 'gap_threshold' here: it is a leader's.",
        ),
        (FOLLOW, {"gap_treshold": 1.0}, "no option 'gap_treshold'. Did you mean 'gap_threshold'?"),
        (FOLLOW, {"cars": 1}, "There is no option 'cars'."),
    ],
)
def test_an_option_that_is_none_is_the_same_error_whoever_makes_it(make, name, options, message):
    with pytest.raises(UsageError) as caught:
        make(name, **options)
    assert message in str(caught.value)


def test_the_time_limit_of_a_single_environment_is_gymnasiums():
    with pytest.raises(UsageError, match=r"no option 'horizon' here\. Use max_episode_steps"):
        gym.make(SAFE, horizon=5)


def test_a_misspelt_camera_is_suggested():
    with pytest.raises(UsageError, match=r"no option 'camra'\. Did you mean 'camera'"):
        gym.make(SAFE, camra="follow")


@pytest.mark.parametrize(
    ("kind", "extra"), [(SafeDriving, set()), (FollowLeader, {"gap_threshold"})]
)
def test_signature_and_docstring_list_the_options(kind, extra):
    shared = {field.name for field in fields(Options)} - {"cars", "horizon", "gap_threshold"}
    parameters = inspect.signature(kind).parameters
    assert set(parameters) == shared | extra | {"render_mode", "camera"}
    assert all(f"\n        {name}: " in kind.__doc__ for name in parameters)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"trakcs": "gm"}, "has no option 'trakcs'. Did you mean 'tracks'?"),
        ({"gap_threshold": 1.0}, "has no option 'gap_threshold'. It has camera, tracks, stacked"),
    ],
)
def test_the_command_line_knows_the_options(options, message):
    with pytest.raises(UsageError) as caught:
        check_options(SAFE, options)
    assert message in str(caught.value)


def test_tracks_may_be_given_as_objects_alone_or_beside_names():
    gm, backwards = load_track("gm"), load_track("gm", reverse=True)
    assert same(simulate(DEFAULTS, tracks=gm).tracks, stack_tracks([gm]))
    both = simulate(DEFAULTS, tracks=[backwards, "trt"]).tracks
    assert same(both, stack_tracks([backwards, load_track("trt")]))
    env = gym.make(SAFE, tracks=gm)
    named = gym.make(SAFE, tracks="gm")
    assert np.array_equal(env.reset(seed=1)[0], named.reset(seed=1)[0])


@pytest.fixture(scope="module")
def map_and_line(tmp_path_factory):
    pytest.importorskip("skimage")
    from tests.carsim.maps import picture, write_centre_line, write_map

    folder = tmp_path_factory.mktemp("a+map")
    free, corner = picture("gm-c")
    return write_map(folder, free, origin=(*corner, 0.0)), write_centre_line(folder, "gm-c")


def test_a_map_may_have_its_centre_line_beside_it(map_and_line):
    from hprs.carsim.map_file import load_map

    path, line = map_and_line
    expected = stack_tracks([load_map(path, centre_line=line)])
    assert not same(expected, stack_tracks([load_map(path)]))
    for tracks in (f"{path}+{line}", map_and_line, [str(path), str(line)], [[path, line]]):
        assert same(simulate(DEFAULTS, tracks=tracks).tracks, expected)
    # The folder's name has a + too.
    assert same(simulate(DEFAULTS, tracks=path).tracks, stack_tracks([load_map(path)]))
    check_options(SAFE, {"tracks": f"{path}+{line}"})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tracks": "line.csv"}, "'line.csv' is a centre line; write it behind its map"),
        ({"tracks": ["gm", "line.csv"]}, "'line.csv' is a centre line"),
        ({"tracks": [["gm", "trt"]]}, "tracks is a name or a list of names, not ['gm', 'trt']"),
        ({"tracks": [3]}, "tracks is a name or a list of names, not 3"),
        ({"tracks": load_track("gm"), "reverse": True}, "load it with reverse=True"),
        ({"tracks": stack_tracks([load_track("gm")])}, "one track, not a stack"),
    ],
)
def test_what_is_no_track_is_one_clear_error(options, message):
    with pytest.raises(UsageError) as caught:
        simulate(DEFAULTS, **options)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_random_tracks_are_named_together_and_backwards():
    names = ["gm", "random:3-4 backwards", "trt backwards"]
    assert track_names(names) == [
        "gm", "random:3 backwards", "random:4 backwards", "trt backwards",
    ]  # fmt: skip
    found = simulate(DEFAULTS, tracks="gm backwards").tracks
    assert same(found, stack_tracks([load_track("gm", reverse=True)]))
    again = simulate(DEFAULTS, tracks="gm backwards", reverse=True).tracks
    assert same(again, stack_tracks([load_track("gm")]))


def test_a_quantity_is_given_a_value_or_a_range():
    given = {"delay": 7, "mass": [2.0, 3]}
    found = simulate(DEFAULTS, tracks="gm", randomisation=given).settings.ranges
    usual = ranges()
    names = [quantity.name for quantity in QUANTITIES]
    for number, name in enumerate(names):
        low, high = {"delay": (7, 7), "mass": (2, 3)}.get(
            name, (usual.low[number], usual.high[number])
        )
        assert (found.low[number], found.high[number]) == (low, high)


def test_without_faults_no_program_has_anything_for_them():
    assert simulate(DEFAULTS, tracks="gm", speed_scale=1, dropped_scans=0).settings.faults is None
    faults = simulate(DEFAULTS, tracks="gm", dropped_scans=0.25).settings.faults
    assert (float(faults.dropped_scans), float(faults.speed_scale)) == (0.25, 1.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tracks": "random:9-3"}, "'random:9-3' needs its first and its last seed"),
        ({"tracks": "random:0-100"}, "'random:0-100' is more than 100 tracks"),
        ({"dropped_scans": 1.5}, "dropped_scans is a number from 0 to 1, got 1.5"),
        ({"speed_offset": "x"}, "speed_offset needs a number, got 'x'"),
        ({"randomisation": {"mas": 3}}, "no randomised quantity 'mas'. Did you mean 'mass'?"),
        ({"randomisation": {"mass": [4, 3]}}, "mass got [4, 3]: a range is two numbers"),
        ({"randomisation": {"mass": [1, 2, 3]}}, "needs a number or [low, high] of mass"),
        ({"randomisation": {"lidar_noise": -1}}, "lidar_noise got [-1, -1], but is at least 0"),
        ({"randomisation": {"delay": 31}}, "at most 30 simulation steps are remembered"),
    ],
)
def test_an_impossible_perturbation_is_one_clear_error(options, message):
    with pytest.raises(UsageError) as caught:
        simulate(DEFAULTS, **{"tracks": "gm", **options})
    assert message in str(caught.value)
