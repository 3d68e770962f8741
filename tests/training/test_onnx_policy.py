"""An ONNX file is a policy wherever its shapes fit, and says where they do not."""

import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from hprs.deploy import BoxLayout, ChoiceLayout, Layer, ObservationLayout
from hprs.deploy.onnx import save_onnx
from hprs.errors import MissingExtraError, PolicyError
from hprs.training.policies import named_policy
from tests.deploy.small import numbers, small

NUMBERS = spaces.Box(-np.inf, np.inf, (2,), np.float32)
PAIR = BoxLayout((2,), numbers(-1, -1), numbers(1, 1))


class Given(gym.Env):
    def __init__(self, observations, actions):
        self.observation_space, self.action_space = observations, actions


@pytest.fixture
def policy(tmp_path):
    def named(bundle, observations, actions):
        save_onnx(bundle, tmp_path / "policy.onnx")
        return named_policy(str(tmp_path / "policy.onnx"), Given(observations, actions))

    return named


def test_it_acts_as_the_bundle_does(policy):
    seen = np.random.default_rng(0).normal(size=(20, 2)).astype(np.float32)
    for layout, space in (
        (PAIR, spaces.Box(-1, 1, (2,), np.float32)),
        (ChoiceLayout(2, start=4), spaces.Discrete(2, start=4)),
    ):
        bundle = small(action=layout)
        found = policy(bundle, NUMBERS, space)
        np.testing.assert_allclose(found.batch(list(seen)), bundle.batch(seen), atol=1e-6)
        np.testing.assert_allclose(found(seen[0]), bundle(seen[0]), atol=1e-6)


def test_of_one_number_a_choice_the_largest_is_taken(policy):
    raw = BoxLayout((2,), numbers(-np.inf, -np.inf), numbers(np.inf, np.inf), "raw")
    identity = Layer(numbers([1, 0], [0, 1]), numbers(0, 0))
    found = policy(small(action=raw, layers=(identity,)), NUMBERS, spaces.Discrete(2, start=5))
    assert found.batch([numbers(1, 2), numbers(2, 1)]).tolist() == [6, 5]


@pytest.mark.parametrize(
    ("bundle", "observations", "actions", "message"),
    [
        (
            small(action=PAIR),
            spaces.Box(-1, 1, (3,)),
            spaces.Box(-1, 1, (2,)),
            "sees observations of shape (2,); this environment has shape (3,)",
        ),
        (
            small(action=PAIR, observation=ObservationLayout((1, 2))),
            NUMBERS,
            spaces.Box(-1, 1, (2,)),
            "sees observations of shape (1, 2); this environment has shape (2,)",
        ),
        (
            small(action=PAIR),
            NUMBERS,
            spaces.Box(-1, 1, (1,)),
            "gives tensor(float) of shape (2,); this environment takes shape (1,)",
        ),
        (
            small(action=PAIR),
            NUMBERS,
            spaces.Discrete(3),
            "gives tensor(float) of shape (2,); this environment takes Discrete(3)",
        ),
        (
            small(action=ChoiceLayout(2)),
            NUMBERS,
            spaces.Box(-1, 1, (1,)),
            "gives tensor(int64) of shape (); this environment takes shape (1,)",
        ),
    ],
)
def test_spaces_that_do_not_fit_are_named_with_both_shapes(
    policy, bundle, observations, actions, message
):
    with pytest.raises(PolicyError) as error:
        policy(bundle, observations, actions)
    assert message in str(error.value)


def test_what_is_no_model_is_said_so(tmp_path):
    given = Given(NUMBERS, spaces.Discrete(2))
    (tmp_path / "text.onnx").write_text("no model")
    for name in ("text.onnx", "none.onnx"):
        with pytest.raises(PolicyError, match="cannot be read as an ONNX model"):
            named_policy(str(tmp_path / name), given)


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'hprs\[onnx\]'"):
        named_policy("policy.onnx", Given(NUMBERS, spaces.Discrete(2)))
