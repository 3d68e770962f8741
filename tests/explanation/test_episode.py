"""An episode that is played for its explanation is the one that an evaluation plays."""

import gymnasium as gym
import numpy as np
import pytest

from hprs import wrap
from hprs.errors import UsageError
from hprs.explanation import episode
from hprs.explanation.episode import record
from hprs.explanation.explanation import explain
from hprs.training.environment import find_task, make_environment
from hprs.training.evaluation import evaluate
from hprs.training.policies import RandomPolicy
from tests.probes import Slider, slider_task

CART_POLE = "hprs/CartPole-v0"


class Drawn(Slider):
    """A slider with a camera, which may fail."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 5}  # noqa: RUF012

    def __init__(self, render_mode=None, picture=None):
        super().__init__()
        self.render_mode, self.picture = render_mode, picture

    def render(self):
        if self.picture is None:
            raise RuntimeError("no\nlight")
        return self.picture


def make_slider(**options):
    return wrap(Slider(), slider_task("conquer"), "sparse")


def make_drawn(picture):
    def make(**options):
        return wrap(Drawn(picture=picture, **options), slider_task("conquer"), "sparse")

    return make


def push(observation):
    return np.array([0.2])


def test_the_numbers_are_those_of_the_wrapper():
    found = record(make_slider, push, seed=3)
    explained = explain(slider_task("conquer"), found.trace)
    environment = wrap(Slider(), slider_task("conquer"), "hprs")
    observation, info = environment.reset(seed=3)
    infos, rewards, ended = [info], [0.0], False
    while not ended:
        observation, reward, terminated, truncated, info = environment.step(push(observation))
        infos.append(info)
        rewards.append(reward)
        ended = terminated or truncated
    assert explained.steps == len(infos) - 1
    assert explained.potential.tolist() == pytest.approx([info["potential"] for info in infos])
    assert (explained.base + explained.shaping).tolist() == pytest.approx(rewards)
    for part in explained.parts:
        assert part.margins.tolist() == [info["margins"][part.label] for info in infos]
        assert part.scores.tolist() == [info["scores"][part.label] for info in infos]
    assert explained.assessment == infos[-1]["assessment"]


def test_the_episode_is_that_of_an_evaluation(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    task, _ = find_task(CART_POLE)

    def make(**options):
        return make_environment(CART_POLE, task, "sparse", **options)

    space = gym.spaces.Discrete(2)
    found = record(make, RandomPolicy(space, 1), seed=2_000_000)
    [evaluated] = evaluate(make, RandomPolicy(space, 1), [2_000_000])
    explained = explain(task, found.trace, rate=found.rate)
    assert explained.assessment == evaluated.assessment
    assert explained.rate == 50
    assert [frame.step for frame in found.film.frames] == list(range(explained.steps + 1))
    assert found.film.trouble == ""


def test_an_environment_without_pictures_is_explained_without():
    found = record(make_slider, push, seed=0)
    assert (found.film.frames, found.rate) == ([], None)
    assert found.film.trouble == "the environment draws none."


@pytest.mark.parametrize(
    ("picture", "trouble"),
    [(None, "RuntimeError: no light"), ("a picture", "the environment drew a str.")],
)
def test_pictures_that_fail_leave_the_numbers(picture, trouble):
    found = record(make_drawn(picture), push, seed=0)
    assert (found.film.frames, found.film.trouble) == ([], trouble)
    assert len(found.trace["x"]) > 2


def test_an_episode_without_end_is_refused(monkeypatch):
    monkeypatch.setattr(episode, "LONGEST", 5)
    with pytest.raises(UsageError, match="more than 5 states; set --horizon"):
        record(make_slider, lambda observation: np.array([0.0]), seed=0)
