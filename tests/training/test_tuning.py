from dataclasses import replace

import pytest

from hprs.envs import BENCHMARKS
from hprs.errors import UsageError
from hprs.training import algorithms
from hprs.training.algorithms import TRAINERS, default_steps, find_algorithm, tuning_of
from hprs.training.configure import configure
from hprs.training.tuning import Tuning, parse_tuning
from tests.training.small import configure_sb3

TEXT = """
steps = 300_000
[ppo]
n_steps = 128
[sb3.ppo]
n_steps = 64
[sb3.sac]
steps = 1_000_000
tau = 0.01
"""

PAPER = {
    "hprs/SafeDriving-v0": (1_000_000, 300_000, 100, 0.005, [256, 256]),
    "hprs/FollowLeader-v0": (1_000_000, 300_000, 100, 0.005, {"pi": [64, 64], "qf": [256, 256]}),
    "hprs/LunarLanderObstacle-v0": (1_500_000, 300_000, 10_000, 0.01, [400, 300]),
    "hprs/BipedalWalker-v0": (2_000_000, 1_000_000, 100, 0.005, [256, 256]),
    "hprs/BipedalWalkerHardcore-v0": (3_000_000, 1_000_000, 100, 0.005, [256, 256]),
}
"""The paper's table of training parameters: steps, buffer, first steps, tau, hidden layers."""


def parse(text):
    return parse_tuning(text, path="here.toml", trainers=TRAINERS)


def test_a_file_says_how_long_with_what_and_how():
    found = parse(TEXT)
    sb3 = {"ppo": {"n_steps": 64}, "sac": {"steps": 1_000_000, "tau": 0.01}}
    assert found == Tuning("here.toml", 300_000, {"jax": {"ppo": {"n_steps": 128}}, "sb3": sb3})
    assert found.table("jax", "ppo") == {"n_steps": 128}
    assert found.table("sb3", "sac") == {"tau": 0.01}
    assert found.table("sb3", "td3") == {}
    assert (found.steps_of("jax", "ppo"), found.steps_of("sb3", "sac")) == (300_000, 1_000_000)


def test_a_table_may_be_like_one_of_our_own():
    found = parse("steps = 9\n[sac]\ntau = 0.01\nsteps = 5\n[sb3.sac]\nlike = 'sac'\nent_coef = 1")
    assert found.table("sb3", "sac") == {"tau": 0.01, "ent_coef": 1}
    assert found.steps_of("sb3", "sac") == 5
    assert found.table("jax", "sac") == {"tau": 0.01}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("steps = 1\n[sac]\n[sb3.sac]\nlike = 'sca'", "here.toml: 'sb3.sac.like' must name a table of the file, sac, got 'sca'."),
        (TEXT.replace("steps =", "stepps =", 1), "here.toml: unknown key 'stepps'. Did you mean 'steps'? It may hold steps, ppo, sac, sb3."),
        (TEXT.replace("[ppo]", "[pppo]"), "here.toml: unknown key 'pppo'. Did you mean 'ppo'? It may hold steps, ppo, sac, sb3."),
        ("[ppo]", "here.toml: 'steps' must be a whole number from 1 on, got None."),
        (TEXT.replace("300_000", "0"), "here.toml: 'steps' must be a whole number from 1 on, got 0."),
        (TEXT.replace("300_000", "true"), "here.toml: 'steps' must be a whole number from 1 on, got True."),
        (TEXT.replace("[sb3.ppo]", "[sb3.pppo]"), "here.toml: unknown key 'sb3.pppo'. Did you mean 'sb3.ppo'? It may hold sb3.ppo, sb3.a2c, sb3.sac, sb3.td3, sb3.ddpg, sb3.dqn."),
        (TEXT.replace("1_000_000", "-1"), "here.toml: 'sb3.sac.steps' must be a whole number from 1 on, got -1."),
        ("steps = 1\nppo = 3", "here.toml: 'ppo' must be a table: [ppo] on a line of its own."),
        ("steps = 1\nsb3 = 3", "here.toml: 'sb3' must be a table: [sb3] on a line of its own."),
        ("steps = 1\nsb3.sac = 3", "here.toml: 'sb3.sac' must be a table: [sb3.sac] on a line of its own."),
        ("steps = ", "here.toml: it is no TOML: Invalid value (at end of document)"),
    ],
)  # fmt: skip
def test_a_wrong_file_is_an_error_with_its_name(text, message):
    with pytest.raises(UsageError) as error:
        parse(text)
    assert str(error.value) == message


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("n_stepps = 1", "hprs/CartPole-v0/mine.toml: ppo has no hyper-parameter 'n_stepps'. Did you mean 'n_steps'?"),
        ("n_steps = 0.5", "hprs/CartPole-v0/mine.toml: ppo's n_steps must be a whole number"),
    ],
)  # fmt: skip
@pytest.mark.parametrize(("table", "trainer"), [("ppo", "jax"), ("sb3.ppo", "sb3")])
def test_a_wrong_hyper_parameter_in_a_file_is_an_error_with_its_name(
    monkeypatch, tmp_path, table, trainer, line, message
):
    package = tmp_path / f"tuning_of_{tmp_path.name}"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "mine.toml").write_text(f"steps = 1\n[{table}]\n{line}\n")
    monkeypatch.syspath_prepend(tmp_path)
    changed = replace(
        BENCHMARKS["hprs/CartPole-v0"], package=package.name, hyperparameters="mine.toml"
    )
    monkeypatch.setattr(algorithms, "benchmark_of", {changed.id: changed}.get)
    with pytest.raises(UsageError) as error:
        configure("hprs/CartPole-v0", trainer=trainer)
    assert str(error.value).startswith(message)


@pytest.mark.parametrize("name", BENCHMARKS)
def test_every_benchmark_has_a_file_that_trains_it(name):
    tuning = tuning_of(name)
    default = configure(name)
    assert (default.trainer, default.algorithm) == ("jax", "ppo")
    assert default.steps == tuning.steps_of("jax", "ppo")
    for trainer, tables in tuning.tables.items():
        for algorithm in tables:
            chosen = configure(name, algorithm=algorithm, trainer=trainer)
            table = tuning.table(trainer, algorithm)
            assert {key: chosen.parameters[key] for key in table} == table
            assert chosen.steps == tuning.steps_of(trainer, algorithm)


@pytest.mark.parametrize("name", PAPER)
def test_the_papers_environments_are_trained_as_in_the_paper(name):
    steps, buffer, first, tau, layers = PAPER[name]
    configuration = configure_sb3(name, algorithm="sac")
    found = configuration.parameters
    assert (configuration.algorithm, configuration.steps) == ("sac", steps)
    assert configuration.evaluation_interval == 10_000
    assert configuration.evaluation_episodes == 10
    assert (found["buffer_size"], found["learning_starts"], found["tau"]) == (buffer, first, tau)
    assert found["net_arch"] == layers
    assert (found["batch_size"], found["gamma"], found["learning_rate"]) == (256, 0.99, 0.0003)
    assert (found["train_freq"], found["gradient_steps"], found["environments"]) == (1, 1, 1)
    assert (found["target_update_interval"], found["ent_coef"]) == (1, "auto")


def test_another_environment_has_no_file():
    assert tuning_of("CartPole-v1") is None
    assert default_steps("CartPole-v1", find_algorithm()) == algorithms.DEFAULT_STEPS
