import json
import sys

import numpy as np
import pytest
from PIL import Image

from hprs.training import sb3
from hprs.training.environment import make_configured
from hprs.training.evaluation import FINAL_SEEDS, evaluate
from hprs.training.listener import Silence
from hprs.training.run_directory import create_runs
from tests.training.small import CART_POLE, ppo

TRACE = """time,x,v,theta
0.00,0.0,0.0,0.0
0.02,0.9,0.7,0.0
0.04,1.0,0.0,0.06
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A training of a moment."""
    [made] = create_runs([ppo(steps=96)], tmp_path_factory.mktemp("runs"))
    assert sb3.train(made, Silence())
    return made


@pytest.fixture
def trace(here):
    (here / "log.csv").write_text(TRACE)


def row(out, name):
    [line] = [line for line in out.splitlines() if line.startswith(name)]
    return line.removeprefix(name).split()


def test_a_trace_is_explained_requirement_by_requirement(hprs, here, trace):
    code, out, err = hprs("explain", "log.csv", "--task", CART_POLE, "--rate", "50")
    assert (code, err) == (0, "")
    assert "2 steps (0.04 s), PAM 1.625: safe, on target, comfort 0.500" in out
    assert row(out, "encourage slow")[:7] == [
        "0.865",
        "1.000",
        "+0.135",
        "0",
        "50.0%",
        "1",
        "(0.02",
    ]
    assert row(out, "ensure on_track")[4:] == ["100.0%", "none", "1.400", "[−2.4,", "2.4]"]  # noqa: RUF001
    assert row(out, "conquer parked")[5:9] == ["met", "from", "1", "(0.02"]
    assert "Wrote explanation.png and explanation.html" in out
    assert sorted(path.name for path in here.glob("explanation.*")) == [
        "explanation.html", "explanation.png",
    ]  # fmt: skip


def test_a_trace_may_have_other_columns_as_for_an_assessment(hprs, here, trace):
    (here / "other.csv").write_text(TRACE.replace("theta", "tilt").replace("time", "when"))
    options = ("--task", CART_POLE, "--json")
    _, plain, _ = hprs("explain", "log.csv", *options)
    code, out, err = hprs(
        "explain", "other.csv", *options, "--column", "theta=tilt", "--time", "when"
    )
    assert (code, err) == (0, "")
    assert json.loads(out)["requirements"] == json.loads(plain)["requirements"]


def test_json_has_the_same_numbers(hprs, trace):
    code, out, _ = hprs("explain", "log.csv", "--task", CART_POLE, "--json", "--out", "x.html")
    content = json.loads(out)
    assert (code, content["pam"], content["steps"], content["rate"]) == (0, 1.625, 2, None)
    for value in content["requirements"]:
        assert value["end"] - value["start"] == pytest.approx(value["earned"] + value["cost"])
    assert sum(value["end"] for value in content["requirements"]) == pytest.approx(
        content["potential"]["end"]
    )
    assert content["written"] == ["x.png", "x.html"]
    assert content["no_pictures_because"] == "a trace has none."


def test_the_episode_of_a_run_is_the_first_that_evaluate_takes(hprs, here, run):
    code, out, err = hprs("explain", run.path, "--json", "--out", "episode")
    assert (code, err) == (0, "")
    content = json.loads(out)
    policy = sb3.load_policy(run, "last")
    [episode] = evaluate(lambda: make_configured(run.configuration), policy, [FINAL_SEEDS])
    assert content["pam"] == episode.assessment.pam
    assert content["steps"] == episode.assessment.length
    assert content["pictures"] == content["steps"] + 1
    assert content["rate"] == 50
    # The reward of the run, as printed in the paper: base rewards and the change of the potential.
    potential = content["potential"]
    held = next(r["held"] for r in content["requirements"] if r["kind"] == "conquer")
    base = held * content["steps"]
    assert episode.total == pytest.approx(base + potential["end"] - potential["start"])
    image = np.asarray(Image.open(here / "episode.png").convert("L"))
    assert image.shape[1] == 1100
    assert image.std() > 10
    assert (here / "episode.html").stat().st_size < 10_000_000


def test_seed_policy_task_and_horizon_can_be_others(hprs, here, run):
    code, out, _ = hprs(
        "explain", run.path, "--seed", "7", "--which", "best", "--horizon", "4", "--const", "mark=-1"
    )  # fmt: skip
    assert code == 0
    assert "best policy, episode 7" in out
    assert "4 steps (0.08 s)" in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("log.csv",), "'log.csv' is a trace: name its task too, as in --task my_task.hprs."),
        (("lg.csv", "--task", CART_POLE), "there is no trace file 'lg.csv'. Did you mean 'log.csv'?"),
        (("log.csv", "--task", CART_POLE, "--seed", "1"), "--seed is for a run; 'log.csv' is a trace."),
        (("log.csv", "--task", CART_POLE, "--env", "a=1"), "--env is for a run; 'log.csv' is a trace."),
        (("runs", "--ticks", "/drive"), "--ticks is for a trace; 'runs' is a run."),
        (("log.csv", "--task", CART_POLE, "--rate", "0"), "--rate must be positive, got 0."),
        (("log.csv", "--task", CART_POLE, "--out", "no/x"), "there is no folder 'no' for --out no/x."),
        (("log.csv", "--task", CART_POLE, "--out", "."), "--out is a file's name without its ending; '.' is a folder."),
        (("runs/nowhere",), "there is no run 'runs/nowhere'."),
        (("runs", "--which", "lst"), "--which is last or best, not 'lst'. Did you mean 'last'?"),
        (("runs", "--horizon", "0"), "--horizon must be at least 1, got 0."),
        (("runs", "--seed", "-1"), "--seed must be at least 0, got -1."),
    ],
)  # fmt: skip
def test_a_wrong_call_is_one_line_and_writes_nothing(hprs, here, trace, arguments, message):
    assert hprs("explain", *arguments) == (2, "", f"hprs: {message}\n")
    assert not list(here.glob("*.png")) + list(here.glob("*.html"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "log.csv is empty; it needs a header of signal names and one row a step."),
        ("x,v\n0,0\n0,0\n", "log.csv has no column 'theta'; it has x, v."),
    ],
)
def test_a_wrong_trace_exits_with_1(hprs, here, text, message):
    (here / "log.csv").write_text(text)
    assert hprs("explain", "log.csv", "--task", CART_POLE) == (1, "", f"hprs: {message}\n")


def test_a_run_without_a_policy_and_a_folder_of_seeds_say_so(hprs, here):
    runs = create_runs([ppo(seed=0), ppo(seed=1)], here / "runs")
    assert hprs("explain", runs[0].path) == (
        2, "", f"hprs: {runs[0].path} has no last policy yet.\n",
    )  # fmt: skip
    assert hprs("explain", runs[0].path.parent) == (
        2, "", f"hprs: '{runs[0].path.parent}' holds 2 seeds; name one, as in {runs[0].path}\n",
    )  # fmt: skip


def test_without_matplotlib_nothing_is_played(hprs, trace, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert hprs("explain", "log.csv", "--task", CART_POLE) == (
        2, "", "hprs: matplotlib is not installed. Install it with: pip install 'hprs[report]'\n",
    )  # fmt: skip
