import math
import typing

import pytest

from hprs.errors import RunError, UsageError
from hprs.training import sb3
from hprs.training.algorithms import TRAINERS
from hprs.training.parameters import known_parameters, resolve_parameters
from hprs.training.ranges import RANGES, Range
from hprs.training.run_directory import create_runs
from hprs.training.sb3.model import make_model, make_vector
from hprs.training.sb3.policy import threads
from tests.training.small import MOUNTAIN, configure_sb3

NAN, INFINITY = math.nan, math.inf

SMALL = {
    "ppo": {"environments": 2, "n_steps": 4, "batch_size": 4, "n_epochs": 1},
    "a2c": {"environments": 2, "n_steps": 4},
    **{name: {"learning_starts": 4, "batch_size": 2} for name in ("sac", "td3", "ddpg", "dqn")},
}
"""Hyper-parameters with which a few steps are a training."""


SB3 = TRAINERS["sb3"]


def is_numeric(kind):
    options = (kind, *typing.get_args(kind))
    return bool({int, float} & set(options)) or kind == list[int]


EVERY = [algorithm for offered in TRAINERS.values() for algorithm in offered.values()]

NUMBERS = [
    (algorithm, name)
    for algorithm in EVERY
    for name, (kind, _) in known_parameters(algorithm).items()
    if is_numeric(kind)
]

NUMERIC = [(algorithm.name, name) for algorithm, name in NUMBERS if algorithm.trainer == "sb3"]


@pytest.fixture(scope="module")
def task(tmp_path_factory):
    path = tmp_path_factory.mktemp("task") / "mountain.hprs"
    path.write_text(MOUNTAIN)
    return str(path)


def configure(task, algorithm, **settings):
    environment = "MountainCar-v0" if algorithm == "dqn" else "MountainCarContinuous-v0"
    return configure_sb3(
        environment,
        task_path=task,
        algorithm=algorithm,
        horizon=6,
        steps=8,
        evaluation_interval=10_000,
        evaluation_episodes=1,
        settings={"net_arch": [4], **SMALL[algorithm], **settings},
    )


def test_every_number_has_a_range():
    assert {name for _, name in NUMBERS} == set(RANGES)


@pytest.mark.parametrize("algorithm", EVERY, ids=lambda found: f"{found.trainer} {found.name}")
def test_what_is_no_finite_number_is_one_line(algorithm):
    known = known_parameters(algorithm)
    for name in (name for owner, name in NUMBERS if owner == algorithm):
        for value in (NAN, INFINITY, -INFINITY, 10**400, True, "nonsense", {}, ["x"], [NAN]):
            with pytest.raises(UsageError) as error:
                resolve_parameters(algorithm, "", {name: value}, known)
            assert str(error.value).startswith(f"{algorithm.name}'s {name} must ")
            assert "\n" not in str(error.value)


@pytest.mark.filterwarnings("ignore:You have specified a mini-batch size")
@pytest.mark.filterwarnings("ignore:The number of environments used is greater than the target")
@pytest.mark.parametrize(("algorithm", "name"), NUMERIC)
def test_a_number_is_refused_in_one_line_or_trains(task, algorithm, name):
    """The ends of a range, and numbers around them."""
    found = RANGES[name]
    accepted = []
    for value in {-1, 0, 1, *filter(None, (found.special,)), *ends(found)}:
        for given in ([value],) if name == "net_arch" else (value, float(value)):
            try:
                configuration = configure(task, algorithm, **{name: given})
            except UsageError as error:
                assert name in str(error)
            else:
                accepted.append(value)
                if value <= 1000:
                    learn(configuration)
    assert accepted
    assert all(value in found for value in accepted)


def learn(configuration):
    environments = make_vector(configuration)
    with threads(1):
        make_model(configuration, environments).learn(configuration.steps)
    environments.close()


@pytest.mark.parametrize("algorithm", [name for name, found in SB3.items() if found.critic])
def test_policy_and_critics_may_have_other_layers(task, algorithm):
    critic = SB3[algorithm].critic
    configuration = configure(task, algorithm, net_arch={"pi": [4], critic: [5, 6]})
    environments = make_vector(configuration)
    model = make_model(configuration, environments)
    shapes = {name: tuple(p.shape) for name, p in model.policy.named_parameters()}
    environments.close()
    networks = {"actor": 4, "policy_net": 4, "critic": 5, "value_net": 5, "qf0": 5}
    firsts = {
        part: shapes[name][0]
        for name in shapes
        for part in networks
        if part in name.split(".") and name.endswith(".0.weight") and "target" not in name
    }
    assert len(firsts) >= 2
    assert all(networks[part] == size for part, size in firsts.items())


def test_an_algorithm_of_one_network_takes_one_list(task):
    with pytest.raises(UsageError) as error:
        configure(task, "dqn", net_arch={"pi": [4], "qf": [4]})
    assert str(error.value).startswith("dqn's net_arch must be a list like [64, 64], got {")


JAX_PPO = TRAINERS["jax"]["ppo"]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"batch_size": 100}, "ppo's batch_size must divide its environments times its n_steps, got 100, 16 and 256."),
        ({"batch_size": 8192}, "ppo's batch_size must divide its environments times its n_steps, got 8192, 16 and 256."),
        ({"batch_size": 1}, "ppo cannot normalise the advantage of one step: raise batch_size, n_steps or environments, or set normalize_advantage=false."),
        ({"log_std_init": -50}, "ppo's log_std_init must lie in [-20, 2], got -50."),
        ({"gae_lambda": 1.5}, "ppo's gae_lambda must lie in [0, 1], got 1.5."),
        ({"clip_range": "linear_0.2"}, 'ppo\'s clip_range must be a number, got "linear_0.2".'),
        ({"learning_rate": "fast"}, 'ppo\'s learning_rate must be a number or a schedule like linear_0.001, got "fast".'),
        ({"net_arch": {"pi": [8], "vf": [8]}}, 'ppo\'s net_arch must be a list like [64, 64], got {"pi": [8], "vf": [8]}.'),
        ({"critic_signals": 1}, "ppo's critic_signals must be true or false, got 1."),
        ({"threads": 2}, "ppo has no hyper-parameter 'threads'."),
    ],
)  # fmt: skip
def test_a_value_that_the_jax_trainer_cannot_mean_is_said(settings, message):
    with pytest.raises(UsageError) as error:
        resolve_parameters(JAX_PPO, "", settings, known_parameters(JAX_PPO))
    assert str(error.value).startswith(message)


def ends(found):
    return (end for end in (found.low, found.high) if abs(end) <= 10**9)


@pytest.mark.parametrize(
    ("algorithm", "settings", "message"),
    [
        ("ppo", {"net_arch": [0]}, "ppo's net_arch must lie in [1, 10000], got [0]."),
        ("ppo", {"net_arch": [8, -5]}, "ppo's net_arch must lie in [1, 10000], got [8, -5]."),
        ("ppo", {"clip_range": -1}, "ppo's clip_range must be positive and finite, got -1."),
        ("ppo", {"clip_range": "linear_-1"}, 'ppo\'s clip_range must be positive and finite, got "linear_-1".'),
        ("ppo", {"learning_rate": "linear_inf"}, 'ppo\'s learning_rate must be a number or a schedule like linear_0.001, got "linear_inf".'),
        ("ppo", {"learning_rate": NAN}, "ppo's learning_rate must lie in (0, 1], got NaN."),
        ("ppo", {"ent_coef": -1}, "ppo's ent_coef must not be negative, and be finite, got -1."),
        ("ppo", {"batch_size": 1}, "ppo cannot normalise the advantage of one step: raise batch_size, n_steps or environments, or set normalize_advantage=false."),
        ("ppo", {"n_steps": 1, "environments": 1}, "ppo cannot normalise the advantage of one step: raise batch_size, n_steps or environments, or set normalize_advantage=false."),
        ("ppo", {"action_noise": 0.1}, "ppo takes no action_noise; sac, td3, ddpg do."),
        ("sac", {"tau": -3}, "sac's tau must lie in (0, 1], got -3."),
        ("sac", {"action_noise": -1}, "sac's action_noise must not be negative, and be finite, got -1."),
        ("sac", {"ent_coef": "autofoo"}, 'sac\'s ent_coef must be a number, auto, or its first value like auto_0.1, got "autofoo".'),
        ("sac", {"ent_coef": "auto_0"}, 'sac\'s ent_coef must be a number, auto, or its first value like auto_0.1, got "auto_0".'),
        ("sac", {"ent_coef": "auto_nan"}, 'sac\'s ent_coef must be a number, auto, or its first value like auto_0.1, got "auto_nan".'),
        ("sac", {"target_entropy": "much"}, "sac's target_entropy must be a number or auto, got 'much'."),
        ("sac", {"target_entropy": INFINITY}, "sac's target_entropy must be finite, got Infinity."),
        ("sac", {"train_freq": [1, "day"]}, 'sac\'s train_freq must be a whole number, or a list like [1, "episode"], got [1, "day"].'),
        ("sac", {"train_freq": [1]}, 'sac\'s train_freq must be a whole number, or a list like [1, "episode"], got [1].'),
        ("sac", {"train_freq": [0, "step"]}, 'sac\'s train_freq must lie in [1, 1000000], got [0, "step"].'),
        ("sac", {"train_freq": [1, "episode"], "environments": 2}, "sac can count train_freq in episodes only with environments=1, got 2."),
        ("sac", {"gradient_steps": 0}, "sac's gradient_steps must be -1, or lie in [1, 1000000], got 0."),
        ("sac", {"gradient_steps": -2}, "sac's gradient_steps must be -1, or lie in [1, 1000000], got -2."),
        ("sac", {"learning_starts": -1}, "sac's learning_starts must lie in [0, 1000000000], got -1."),
        ("sac", {"buffer_size": 1}, "sac's buffer_size must be at least its batch_size, got 1 and 2."),
        ("sac", {"buffer_size": 8, "n_steps": 9}, "sac's buffer_size must be at least its n_steps times its environments, got 8, 9 and 1."),
        ("dqn", {"exploration_fraction": 0}, "dqn's exploration_fraction must lie in (0, 1], got 0."),
        ("dqn", {"net_arch": [10**400]}, f"dqn's net_arch must lie in [1, 10000], got [1{'0' * 55}...."),
    ],
)  # fmt: skip
def test_a_value_out_of_range_is_said(task, algorithm, settings, message):
    with pytest.raises(UsageError) as error:
        configure(task, algorithm, **settings)
    assert str(error.value) == message


def test_exploration_that_depends_on_the_state_needs_continuous_actions(task):
    with pytest.raises(UsageError, match=r"^ppo's use_sde needs actions of a Box space, not"):
        configure_sb3("hprs/CartPole-v0", settings={"use_sde": True})


@pytest.mark.parametrize(
    ("algorithm", "settings"),
    [
        ("ppo", {"batch_size": 1, "normalize_advantage": False}),
        ("ppo", {"clip_range": "linear_0.2", "target_kl": 0.01, "clip_range_vf": 1}),
        ("a2c", {"use_sde": True, "sde_sample_freq": 2}),
        ("sac", {"ent_coef": "auto_0.1", "target_entropy": -1}),
        ("sac", {"train_freq": [1, "episode"], "gradient_steps": -1}),
        ("td3", {"n_steps": 3, "environments": 2}),
    ],
)
def test_unusual_values_that_mean_something_train(task, algorithm, settings):
    learn(configure(task, algorithm, **settings))


@pytest.mark.parametrize(
    ("algorithm", "settings"),
    [
        ("ppo", {"policy_kwargs": {"net_arch": [-5]}}),
        ("ppo", {"policy_kwargs": {"nonsense": 1}}),
        ("ppo", {"policy_kwargs": {"activation_fn": "relu"}}),
        ("sac", {"replay_buffer_kwargs": {"nonsense": 1}}),
    ],
)
def test_what_only_stable_baselines_can_judge_is_one_line(task, algorithm, settings):
    with pytest.raises(UsageError, match=r"^Stable-Baselines3 refuses this training: "):
        learn(configure(task, algorithm, **settings))


@pytest.mark.parametrize(
    ("algorithm", "settings"), [("ppo", {"vf_coef": 1e300}), ("sac", {"ent_coef": 1e300})]
)
def test_a_training_that_diverges_is_one_line(task, tmp_path, algorithm, settings):
    [run] = create_runs([configure(task, algorithm, **settings)], tmp_path)
    with pytest.raises(RunError, match=r"^the training diverged before step \d+: its networks"):
        sb3.train(run)


def test_a_range_says_what_it_wants():
    assert str(Range(1.0)) == "be at least 1"
    assert str(Range(0.0, 0.5)) == "lie in [0, 0.5]"
    assert NAN not in Range(-INFINITY, INFINITY)
