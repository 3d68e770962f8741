import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from hprs.errors import PolicyError, UsageError
from hprs.training import sb3
from hprs.training.policies import ForeignPolicy, check_fits, import_policy

NAN, INFINITY = float("nan"), float("inf")
NAME = "policies_beside_the_user"
TEXT = """
def left(observation):
    return 0

def fail(observation):
    return {}["missing"]

x = 3
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path != ""])
    (tmp_path / f"{NAME}.py").write_text(TEXT)
    (tmp_path / "raising_policies.py").write_text("x = 1\nraise ValueError('not today')\n")
    (tmp_path / "misspelt_policies.py").write_text("def f(:\n")
    (tmp_path / "needing_policies.py").write_text("import a_module_that_is_missing\n")
    yield
    sys.modules.pop(NAME, None)


def load(name):
    return import_policy(name, spaces.Discrete(2))


def test_a_policy_is_found_beside_the_user(here):
    assert load(f"{NAME}:left")(None) == 0


@pytest.mark.parametrize(
    ("name", "kind", "message"),
    [
        (f"{NAME}:right", UsageError, f"policy '{NAME}:right': module '{NAME}' has no function 'right'."),
        (f"{NAME}:x", UsageError, f"policy '{NAME}:x': module '{NAME}' has no function 'x'."),
        (f"{NAME}:", UsageError, f"policy '{NAME}:': module '{NAME}' has no function ''."),
        (":left", UsageError, "policy ':left': '' is not a module's name."),
        ("a/b.py:left", UsageError, "policy 'a/b.py:left': 'a/b.py' is not a module's name."),
        ("my_policie:left", UsageError, "policy 'my_policie:left': there is no module 'my_policie'."),
        ("needing_policies:f", UsageError, "policy 'needing_policies:f': there is no module 'a_module_that_is_missing'."),
        ("raising_policies:f", PolicyError, "policy 'raising_policies:f': module 'raising_policies' cannot be imported: ValueError: not today (raising_policies.py, line 2)"),
        ("misspelt_policies:f", PolicyError, "policy 'misspelt_policies:f': module 'misspelt_policies' cannot be imported: invalid syntax (misspelt_policies.py, line 1)"),
    ],
)  # fmt: skip
def test_a_policy_that_cannot_be_imported_is_said(here, name, kind, message):
    with pytest.raises(kind) as error:
        load(name)
    assert str(error.value) == message


def test_a_policy_that_fails_says_where(here):
    with pytest.raises(PolicyError) as error:
        load(f"{NAME}:fail")(None)
    assert str(error.value) == (
        f"policy '{NAME}:fail' fails: KeyError: 'missing' ({NAME}.py, line 6)"
    )


@pytest.mark.parametrize(
    ("space", "action", "expected"),
    [
        (spaces.Discrete(2), 1, 1),
        (spaces.Discrete(2), np.int64(1), 1),
        (spaces.Discrete(2), np.array(1), 1),
        (spaces.Discrete(2), np.array([1]), 1),
        (spaces.Box(-1, 1, (2,)), [0.5, 1], [0.5, 1]),
        (spaces.Box(-1, 1, (2,)), (-3, INFINITY), [-1, 1]),
        (spaces.Box(-1, 1, ()), 0.5, 0.5),
        (spaces.MultiBinary(2), np.array([0, 1], np.int8), [0, 1]),
    ],
)
def test_an_action_of_the_space_is_taken(space, action, expected):
    found = ForeignPolicy("mine", lambda _: action, space)(None)
    assert space.contains(found)
    assert np.array_equal(found, expected)


@pytest.mark.parametrize(
    ("space", "action"),
    [
        *((spaces.Discrete(2), action) for action in (None, 2, -1, 0.0, NAN, "0", [0], {}, np.zeros(3))),
        *((spaces.Box(-1, 1, (2,)), action) for action in (None, 0.5, [0.5], [NAN, 0], "ab", [[0, 0]], {}, [None, 1])),
        (spaces.MultiDiscrete([2, 2]), np.array([2, 0])),
        (spaces.Tuple((spaces.Discrete(2),)), 0),
    ],
)  # fmt: skip
def test_anything_else_is_refused_in_one_line(space, action):
    with pytest.raises(
        PolicyError, match=r"^policy 'mine' returned .*, which is no action of "
    ) as e:
        ForeignPolicy("mine", lambda _: action, space)(None)
    assert "\n" not in str(e.value)


def test_a_network_of_the_users_own_is_a_policy_and_another_librarys_is_none(tmp_path):
    from stable_baselines3 import PPO
    from stable_baselines3.common.policies import ActorCriticPolicy

    own = type("Own", (ActorCriticPolicy,), {"__module__": "__main__"})
    model = PPO(own, "CartPole-v1", n_steps=8, batch_size=8, device="cpu")
    model.save(tmp_path / "own.zip")
    assert isinstance(sb3.load_zip(tmp_path / "own.zip").model, PPO)
    model.policy_class = dict
    model.save(tmp_path / "other.zip")
    with pytest.raises(UsageError, match=r"other.zip' holds no policy of PPO: "):
        sb3.load_zip(tmp_path / "other.zip")


class Spaces(gym.Env):
    def __init__(self, observation, action):
        self.observation_space, self.action_space = observation, action


class Trained:
    def __init__(self, spaces):
        self.spaces = spaces

    def __call__(self, observation):
        raise AssertionError


BOX, WIDE = spaces.Box(-1, 1, (2,)), spaces.Box(-2, 2, (2,))
LONG, TWO, THREE = spaces.Box(-1, 1, (3,)), spaces.Discrete(2), spaces.Discrete(3)


@pytest.mark.parametrize("observation", [BOX, WIDE])
def test_a_policy_may_have_been_trained_with_other_bounds(observation):
    check_fits("x.zip", Trained((BOX, TWO)), Spaces(observation, TWO))
    check_fits("x.zip", Trained((spaces.Dict(a=BOX), TWO)), Spaces(spaces.Dict(a=observation), TWO))


@pytest.mark.parametrize(
    ("trained", "here", "word"),
    [
        ((BOX, TWO), (LONG, TWO), "observations of Box(-1.0, 1.0, (2,), float32)"),
        ((BOX, TWO), (TWO, TWO), "observations of Box"),
        ((BOX, TWO), (BOX, THREE), "actions of Discrete(2)"),
        ((BOX, TWO), (BOX, BOX), "actions of Discrete(2)"),
        ((spaces.Dict(a=BOX), TWO), (spaces.Dict(b=BOX), TWO), "observations of Dict"),
        ((spaces.Dict(a=BOX), TWO), (spaces.Dict(a=LONG), TWO), "observations of Dict"),
    ],
)
def test_a_policy_for_other_spaces_is_refused(trained, here, word):
    with pytest.raises(PolicyError) as error:
        check_fits("x.zip", Trained(trained), Spaces(*here))
    assert str(error.value).startswith(f"policy 'x.zip' was trained with {word}")
