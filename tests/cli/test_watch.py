import io

import numpy as np
import pytest
from PIL import Image

CART_POLE = "hprs/CartPole-v0"
RANDOM = ("watch", CART_POLE, "--policy", "random")


def opened(path):
    return Image.open(io.BytesIO(path.read_bytes()))


def test_an_episode_is_filmed_with_all_of_its_steps(hprs, here):
    code, out, err = hprs(*RANDOM, "--horizon", "12", "--out", "cart.webp")
    assert (code, err) == (0, "")
    assert "policy random, episode 2000000: 12 steps" in out
    picture = opened(here / "cart.webp")
    # 50 steps a second, every second one of which is shown.
    assert picture.n_frames == 7
    assert picture.size[0] == 900


def test_best_and_worst_are_those_of_the_episodes_of_evaluate(hprs, here):
    from hprs.training.environment import find_task, make_environment
    from hprs.training.evaluation import FINAL_SEEDS, episode_seeds, evaluate
    from hprs.training.policies import do_nothing

    task, _ = find_task(CART_POLE)

    def make():
        return make_environment(CART_POLE, task)

    environment = make()
    policy = do_nothing(environment.action_space)
    found = evaluate(make, policy, episode_seeds(FINAL_SEEDS, 8))
    pams = [float(episode.assessment.pam) for episode in found]
    for option, place in (("--best", np.argmax(pams)), ("--worst", np.argmin(pams))):
        zero = ("watch", CART_POLE, "--policy", "zero", option, "--episodes", "8")
        code, out, _ = hprs(*zero, "--out", "cart.webp")
        assert code == 0
        assert f"episode {FINAL_SEEDS + place}: {found[place].assessment.length} steps" in out


def test_a_violation_is_looked_for_and_may_not_be_there(hprs, here):
    code, out, _ = hprs(*RANDOM, "--violation", "--episodes", "4", "--out", "cart.webp")
    assert code == 0
    assert "not safe" in out
    short = ("--violation", "--episodes", "3", "--horizon", "2", "--out", "cart.webp")
    code, _, err = hprs(*RANDOM, *short)
    assert code == 1
    assert "no safety requirement is violated in 3 episodes" in err


def test_a_log_is_filmed_without_a_scene(hprs, here):
    (here / "log.csv").write_text("position,velocity\n-0.5,0\n-0.4,0.01\n0.5,0.06\n")
    code, out, _ = hprs("watch", "log.csv", "--task", "mountain.hprs", "--out", "log.gif")
    assert code == 0
    assert "No pictures: a log has none." in out
    assert opened(here / "log.gif").n_frames == 3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((CART_POLE, "--policy", "zero", "--out", "cart.avi"), "a video's name ends in"),
        ((CART_POLE, "--policy", "zero", "--out", "no/cart.gif"), "there is no folder 'no'"),
        ((CART_POLE, "--policy", "zero", "--best", "--seed", "3"), "--best and --seed exclude"),
        ((CART_POLE, "--policy", "zero", "--best", "--worst"), "--best and --worst exclude"),
        ((CART_POLE, "--policy", "zero", "--rate", "0"), "--rate must be positive"),
        (("nowhere",), "there is no run 'nowhere'"),
        (("mountain.hprs", "--best"), "--best, --worst, --violation and --seed are for a policy"),
        (("mountain.hprs",), "'mountain.hprs' is a log: name its task too"),
    ],
)
def test_mistakes_are_explained(hprs, arguments, message):
    code, out, err = hprs("watch", *arguments)
    assert code in (1, 2)
    assert out == ""
    assert err.startswith(f"hprs: {message}")
