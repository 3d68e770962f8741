from collections.abc import Callable

import pytest

from hprs.errors import UsageError
from hprs.training.algorithms import (
    ALGORITHMS,
    OURS,
    TRAINERS,
    check_spaces,
    find_algorithm,
    parse_settings,
)
from hprs.training.parameters import known_parameters, resolve_parameters
from hprs.training.schedules import Linear, schedule

OWN = {
    **{name: (kind, value) for name, (kind, value, _) in OURS.items()},
    "learning_rate": (float | Callable[[float], float], 3e-4),
    "n_steps": (int, 2048),
    "batch_size": (int, 64),
    "gamma": (float, 0.99),
    "target_kl": (float | None, None),
    "use_sde": (bool, False),
    "train_freq": (int | tuple[int, str], 1),
    "ent_coef": (str | float, "auto"),
    "policy_kwargs": (dict[str, object] | None, None),
}


SB3 = TRAINERS["sb3"]


def resolve(**overrides):
    return resolve_parameters(SB3["ppo"], "CartPole-v1", overrides, OWN)


def test_ppo_with_the_jax_trainer_is_the_default():
    assert find_algorithm() is find_algorithm("ppo") is TRAINERS["jax"]["ppo"]
    assert find_algorithm(trainer="sb3") is SB3["ppo"]


@pytest.mark.parametrize("name", ALGORITHMS)
def test_an_algorithm_is_trained_by_the_first_trainer_that_offers_it(name):
    assert find_algorithm(name.upper()).trainer == ("jax" if name in TRAINERS["jax"] else "sb3")
    assert find_algorithm(name, "sb3") is SB3[name]


def test_a_trainer_that_lacks_an_algorithm_says_who_has_it():
    with pytest.raises(UsageError) as error:
        find_algorithm("td3", "jax")
    assert str(error.value) == (
        "the trainer jax has no td3; it has ppo, sac. For td3: --trainer sb3."
    )
    with pytest.raises(UsageError) as error:
        find_algorithm(None, "sb33")
    assert str(error.value) == (
        "unknown trainer 'sb33'; choose one of jax, sb3. Did you mean 'sb3'?"
    )


def test_an_unknown_algorithm_gets_a_suggestion():
    with pytest.raises(UsageError, match=r"unknown algorithm 'pppo'.*Did you mean 'ppo'"):
        find_algorithm("pppo")


def test_an_algorithm_refuses_actions_it_cannot_handle():
    with pytest.raises(
        UsageError,
        match=r"^sac cannot handle actions of a Discrete space; choose one of ppo, a2c, dqn.$",
    ):
        check_spaces(SB3["sac"], "Discrete")
    with pytest.raises(UsageError, match=r"no algorithm can"):
        check_spaces(SB3["ppo"], "Tuple")


@pytest.mark.parametrize(
    ("spaces", "message"),
    [
        (("MultiDiscrete",), "actions of a MultiDiscrete space; that of sb3 can: --trainer sb3."),
        (("Box", "Dict"), "observations of a Dict space; that of sb3 can: --trainer sb3."),
    ],
)
def test_what_the_jax_trainer_cannot_handle_names_the_one_that_can(spaces, message):
    check_spaces(SB3["ppo"], *spaces)
    with pytest.raises(UsageError) as error:
        check_spaces(TRAINERS["jax"]["ppo"], *spaces)
    assert str(error.value) == f"ppo of the trainer jax cannot handle {message}"


def test_defaults_of_lists_are_not_shared():
    known = known_parameters(TRAINERS["jax"]["ppo"])
    one, two = (resolve_parameters(TRAINERS["jax"]["ppo"], "", {}, known) for _ in range(2))
    assert one == two
    assert one["net_arch"] is not two["net_arch"]


def test_settings_are_json_or_text():
    assert parse_settings(
        ["a=1", "b=0.5", "c=[1,2]", "d=auto_0.02", "e=true", "f=None", "g=x=y"]
    ) == {
        "a": 1,
        "b": 0.5,
        "c": [1, 2],
        "d": "auto_0.02",
        "e": True,
        "f": None,
        "g": "x=y",
    }


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (["a"], "--set takes KEY=VALUE, got 'a'."),
        (["=1"], "--set takes KEY=VALUE, got '=1'."),
        (["a=1", "a=2"], "--set a is given twice."),
    ],
)
def test_wrong_settings_are_refused(settings, message):
    with pytest.raises(UsageError) as error:
        parse_settings(settings)
    assert str(error.value) == message


def test_what_the_user_sets_wins_over_the_tables():
    assert resolve()["n_steps"] == SB3["ppo"].parameters["n_steps"]
    assert resolve(n_steps=5)["n_steps"] == 5
    assert resolve()["net_arch"] == [64, 64]
    assert resolve_parameters(SB3["ppo"], "hprs/CartPole-v0", {}, OWN)["n_steps"] != 2048


def test_sac_starts_with_little_entropy():
    parameters = resolve_parameters(SB3["sac"], "CartPole-v1", {}, OWN)
    assert parameters["ent_coef"] == "auto_0.02"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("learning_rate", 1),
        ("learning_rate", "linear_0.001"),
        ("target_kl", None),
        ("target_kl", 0.1),
        ("train_freq", [1, "step"]),
        ("ent_coef", "auto_0.1"),
        ("use_sde", True),
        ("net_arch", [8]),
        ("net_arch", {"pi": [8], "vf": [16, 16]}),
        ("policy_kwargs", {"ortho_init": False}),
    ],
)
def test_values_of_the_right_type_are_taken(name, value):
    assert resolve(**{name: value})[name] == value


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("n_steps", "many", 'ppo\'s n_steps must be a whole number, got "many".'),
        ("n_steps", 1.5, "ppo's n_steps must be a whole number, got 1.5."),
        ("n_steps", True, "ppo's n_steps must be a whole number, got true."),
        ("n_steps", 0, "ppo's n_steps must lie in [1, 1000000], got 0."),
        ("gamma", 2, "ppo's gamma must lie in (0, 1], got 2."),
        ("use_sde", 1, "ppo's use_sde must be true or false, got 1."),
        ("target_kl", "x", 'ppo\'s target_kl must be a number or null, got "x".'),
        (
            "learning_rate",
            "linear_x",
            'ppo\'s learning_rate must be a number or a schedule like linear_0.001, got "linear_x".',
        ),
        ("net_arch", [1.5], "ppo's net_arch must be a list like [64, 64], got [1.5]."),
        (
            "net_arch",
            {"pi": [8], "qf": [8]},
            "ppo's net_arch must be a list like [64, 64], or an object like "
            '{"pi": [64, 64], "vf": [256, 256]}, got {"pi": [8], "qf": [8]}.',
        ),
        (
            "net_arch",
            {"pi": [8], "vf": 8},
            "ppo's net_arch must be a list like [64, 64], got 8.",
        ),
        (
            "net_arch",
            {"pi": [8], "vf": [0]},
            "ppo's net_arch must lie in [1, 10000], got [0].",
        ),
        ("policy_kwargs", 3, "ppo's policy_kwargs must be a JSON object or null, got 3."),
        (
            "lerning_rate",
            1,
            "ppo has no hyper-parameter 'lerning_rate'. Did you mean 'learning_rate'?",
        ),
    ],
)
def test_wrong_values_are_refused_with_a_reason(name, value, message):
    with pytest.raises(UsageError) as error:
        resolve(**{name: value})
    assert str(error.value) == message


def test_a_linear_schedule_falls_to_zero():
    assert schedule("linear_0.5") == Linear(0.5)
    assert [Linear(0.5)(remaining) for remaining in (1.0, 0.5, 0.0)] == [0.5, 0.25, 0.0]
    assert schedule("auto") == "auto"
    assert schedule(3) == 3
