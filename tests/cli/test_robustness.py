from __future__ import annotations

import csv

import numpy as np
import pytest

from hprs.cli.robustness import sweeps_of
from hprs.cli.robustness_subject import subject_of
from hprs.deploy import BoxLayout, Bundle, Layer, ObservationLayout, save_bundle
from hprs.experiments.perturbations import TRACK, perturbations

SAFE, FOLLOW = "hprs/SafeDriving-v0", "hprs/FollowLeader-v0"


def bundle(path, *, seen=71, throttle=1.0, task=None, **provenance):
    """A policy that drives straight on."""
    one = np.ones(2, np.float32)
    layer = Layer(np.zeros((seen, 2), np.float32), np.array([throttle, 0], np.float32))
    made = Bundle(
        layers=(layer,),
        observation=ObservationLayout((seen,)),
        action=BoxLayout((2,), -one, one, "clip"),
        task=task or {},
        provenance=provenance,
    )
    save_bundle(made, path)
    return path


def test_two_policies_side_by_side(hprs, here):
    names = [bundle(here / "fast.bundle"), bundle(here / "slow.bundle", throttle=0.1)]
    code, out, err = hprs(
        "robustness", *names, "--on", SAFE, "--env", "tracks=gm", "--sweep", "latency=0,100",
        "--episodes", "2", "--out", "found",
    )  # fmt: skip
    assert (code, err) == (0, "")
    assert out.startswith("A  fast\nB  slow\n")
    assert "100 ms" in out
    assert "2 episodes a point" in out
    assert {path.name for path in (here / "found").iterdir()} == {
        f"robustness.{ending}" for ending in ("csv", "png", "svg")
    }
    rows = list(csv.DictReader((here / "found" / "robustness.csv").read_text().splitlines()))
    assert [(row["policy"], row["value"], row["trained"]) for row in rows] == [
        (policy, value, trained)
        for policy in ("fast", "slow")
        for value, trained in (("", "yes"), ("0", "yes"), ("100", "no"))
    ]


def test_sweeps_are_named_with_or_without_values():
    assert sweeps_of(()) == {**perturbations(), TRACK: ()}
    assert sweeps_of(("latency", "mass=4,3,4")) == {
        "latency": perturbations()["latency"],
        "mass": [3.0, 4.0],
    }


def test_a_bundle_says_what_it_has_seen(tmp_path):
    from hprs.envs.registration import BENCHMARKS
    from hprs.spec.json_format import task_to_json

    options = {"tracks": ["random:3-4", "trt backwards"], "reverse": True}
    path = str(
        bundle(
            tmp_path / "a.bundle",
            task=task_to_json(BENCHMARKS[SAFE].task),
            environment=SAFE,
            environment_options=options,
        )
    )
    expected = ["random:3 backwards", "random:4 backwards", "trt"]
    for on in (None, FOLLOW):
        found = subject_of(path, on=on, which="last", options=())
        assert (found.seen, found.environment) == (expected, SAFE)


def test_a_bundle_that_does_not_say_is_believed_what_the_user_says(tmp_path):
    path = str(bundle(tmp_path / "a.bundle"))
    assert subject_of(path, on=SAFE, which="last", options=()).seen == ["gm", "trt"]
    found = subject_of(path, on=SAFE, which="last", options=('tracks="random:5-6 backwards"',))
    assert found.seen == ["random:5 backwards", "random:6 backwards"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("a.bundle",), "'a.bundle' does not say where it was trained; name the environment"),
        (("a.bundle", "a.bundle", "--on", SAFE), "'a.bundle' is named twice"),
        (("a", "b", "c"), "one or two policies are tested, not 3"),
        (("a.bundle", "--on", SAFE, "--episodes", "0"), "--episodes must be at least 1, got 0"),
        (("a.bundle", "--on", SAFE, "--which", "first"), "--which is last or best"),
        (("a.bundle", "--on", "hprs/CartPole-v0"), "'a.bundle' is of hprs/CartPole-v0; robustness"),
        (("a.bundle", "--on", FOLLOW), "policy 'a.bundle' sees observations of shape (71,)"),
        (("nowhere", "--on", SAFE), "there is no run 'nowhere'"),
        (("a.bundle", "--on", SAFE, "--sweep", "latncy"), "There is no perturbation 'latncy'. Did"),
        (("a.bundle", "--on", SAFE, "--sweep", "mass=x"), "--sweep mass needs numbers between"),
        (("a.bundle", "--on", SAFE, "--sweep", "track=gm"), "--sweep track has no values"),
        (("a.bundle", "--on", SAFE, "--sweep", "mass=-1"), "mass got [-1, -1], but is above 0"),
    ],
)
def test_mistakes_are_explained(hprs, here, arguments, message):
    bundle(here / "a.bundle")
    code, out, err = hprs("robustness", *arguments)
    assert code in (1, 2)
    assert out == ""
    assert err.startswith(f"hprs: {message}")
    assert err.count("\n") == 1
