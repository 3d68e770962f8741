import json

import pytest


def test_check_prints_kind_predicate_bounds_and_order(hprs):
    code, out, err = hprs("check", "hprs/CartPole-v0")
    assert (code, err) == (0, "")
    lines = [line.split() for line in out.splitlines()]
    assert ["on_track", "ensure", "abs(x)", "<=", "2.4", "[-2.4,", "2.4]", "-"] in lines
    assert [
        "slow", "encourage", "abs(v)", "<=", "0.5", "[-2.5,", "0.5]", "on_track,", "pole_up,", "parked",
    ] in lines  # fmt: skip


def test_check_reads_a_file(hprs):
    code, out, _ = hprs("check", "mountain.hprs")
    assert code == 0
    assert "position >= 0.45" in out


def test_check_takes_other_constants(hprs, here):
    code, out, _ = hprs("check", "hprs/CartPole-v0", "--const", "mark=-2", "--json")
    assert code == 0
    parked = json.loads(out)["requirements"][2]
    assert (parked["label"], parked["low"]) == ("parked", pytest.approx(-6.55))
    code, out, err = hprs("check", "hprs/CartPole-v0", "--const", "marc=1")
    assert (code, out) == (1, "")
    assert err == "hprs/CartPole-v0: the task has no constant 'marc'. Did you mean 'mark'?\n"
    code, _, err = hprs("check", "hprs/CartPole-v0", "--const", "mark")
    assert (code, err) == (
        2,
        "hprs: a constant is given as NAME=VALUE, as in mark=-1; got 'mark'.\n",
    )


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_a_constant_that_cannot_be_meant_shows_the_line(hprs, here, ending):
    text = "# A mark.\nsignal x in [-3, 3]\nconst mark = 1\nconquer parked: abs(x - mark) <= 0.25\n"
    (here / "c.hprs").write_bytes(text.replace("\n", ending).encode())
    code, out, err = hprs("check", "c.hprs", "--const", "mark=100")
    assert (code, out) == (1, "")
    assert err.splitlines() == [
        "c.hprs:4:9: requirement 'parked' can never be satisfied: its margin lies in [-102.75, -96.75]. The threshold 0.25 is outside the range [97, 103]. Here, mark = 100.",
        "    4 | conquer parked: abs(x - mark) <= 0.25",
        "      |         ^^^^^^",
    ]
    code, _, err = hprs("check", "hprs/CartPole-v0", "--const", "mark=100")
    assert code == 1
    assert " | conquer   parked:" in err


def test_a_wrong_task_exits_with_1_and_a_caret(hprs, here):
    (here / "wrong.hprs").write_text("signal x = obs[0] in [0, 1]\nensure low: y <= 0.5\n")
    code, out, err = hprs("check", "wrong.hprs")
    assert (code, out) == (1, "")
    assert err.splitlines()[0].startswith("wrong.hprs:2:13: unknown name 'y'.")
    assert err.splitlines()[2] == "      |             ^"


def test_remarks_are_warnings_with_their_line(hprs, here):
    (here / "odd.hprs").write_text(
        "signal x = obs[0] in [0, 1]\nsignal y = obs[1] in [0, 1]\nachieve low: x <= 0.5\n"
    )
    code, _, err = hprs("check", "odd.hprs")
    assert code == 0
    assert err.startswith("odd.hprs:2: warning: ")
    assert "y" in err


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("montain.hprs", "hprs: there is no task 'montain.hprs'. Did you mean 'mountain.hprs'?\n"),
        ("hprs/CartPol-v0", "hprs: there is no task 'hprs/CartPol-v0'. Did you mean 'hprs/CartPole-v0'?\n"),
    ],
)  # fmt: skip
def test_an_unknown_task_exits_with_2_and_a_suggestion(hprs, name, message):
    assert hprs("check", name) == (2, "", message)


def test_check_prints_json_with_null_for_infinity(hprs, here):
    (here / "open.hprs").write_text("signal x = obs[0] in [-inf, inf]\nensure low: x <= 0.5\n")
    code, out, _ = hprs("check", "open.hprs", "--json")
    assert code == 0
    content = json.loads(out)
    assert content["requirements"][0] == {
        "label": "low",
        "kind": "ensure",
        "predicate": "x <= 0.5",
        "low": None,
        "high": None,
        "ranks_below": [],
    }
    assert content["remarks"][0]["message"]


def test_tasks_lists_the_benchmarks(hprs):
    code, out, err = hprs("tasks")
    assert (code, err) == (0, "")
    assert "hprs/CartPole-v0" in out
    # Cells may be broken into lines.
    assert all(label in out for label in ("on_track", "pole_up", "parked", "upright", "slow"))


def test_tasks_prints_json(hprs):
    _, out, _ = hprs("tasks", "--json")
    assert json.loads(out)[0]["horizon"] == 500
