import json

import pytest

CART_POLE = "hprs/CartPole-v0"
ON = ("--on", CART_POLE, "--episodes", "4")


def test_a_policy_is_as_good_as_itself(hprs):
    code, out, _ = hprs("compare", "zero", "zero", *ON, "--json")
    found = json.loads(out)
    assert code == 0
    assert (found["better"], found["worse"], found["probability"]) == (0, 0, 0.5)
    assert {row["difference"]["value"] for row in found["measures"].values()} == {0.0}


def test_two_policies_play_the_same_episodes(hprs):
    _, alone, _ = hprs("evaluate", CART_POLE, "--policy", "zero", "--episodes", "4", "--json")
    code, out, err = hprs("compare", "zero", "random", *ON, "--json")
    found = json.loads(out)["measures"]
    assert (code, err) == (0, "")
    for name, measure in json.loads(alone)["measures"].items():
        assert found[name]["one"] == pytest.approx(measure["value"])
    floors = json.loads(alone)["floors"]["random"]
    for name, measure in floors.items():
        assert found[name]["other"] == pytest.approx(measure["value"])


def test_the_table_says_who_is_who(hprs):
    code, out, _ = hprs("compare", "zero", "random", *ON)
    assert code == 0
    assert out.startswith("one    zero\nother  random\n4 episodes each, the same for both\n")
    assert "other - one" in out
    assert "ties count half" in out


def test_a_run_brings_its_environment(hprs, here):
    train = ("train", CART_POLE, "--steps", "2048", "--seeds", "2", "--set", "n_steps=64")
    assert hprs(*train, "--workers", "0")[0] == 0
    (folder,) = (path for path in (here / "runs" / "hprs-CartPole-v0").iterdir() if path.is_dir())
    code, out, _ = hprs("compare", folder, "zero", "--episodes", "3")
    assert code == 0
    assert "The spread between seeds is not in them." in out
    code, out, _ = hprs("compare", "zero", folder / "seed-0", "--episodes", "3", "--json")
    assert code == 0
    assert json.loads(out)["episodes"] == 3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("zero", "random"), "neither 'zero' nor 'random' is a run: name the environment"),
        (("zero", "nowhere", "--on", CART_POLE), "there is no run 'nowhere'"),
        (("zero", "gone.bundle", "--on", CART_POLE), ""),
        (("zero", "random", "--on", CART_POLE, "--episodes", "0"), "--episodes must be at least 1"),
        (("zero", "random", "--on", CART_POLE, "--which", "first"), "--which is last or best"),
    ],
)
def test_mistakes_are_explained(hprs, arguments, message):
    code, out, err = hprs("compare", *arguments)
    assert code in (1, 2)
    assert out == ""
    assert err.startswith(f"hprs: {message}")
