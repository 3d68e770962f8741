"""Grids: what a file says, and what it cannot."""

from pathlib import Path

import pytest

from hprs.errors import GridError, UsageError
from hprs.experiments.grid import configurations_of, read_grid

GRIDS = Path(__file__).parents[2] / "examples" / "grids"
CART_POLE = '[[runs]]\nenvironment = "hprs/CartPole-v0"\n'


def grid(tmp_path, text):
    path = tmp_path / "grid.toml"
    path.write_text(text)
    return read_grid(path)


def test_a_block_is_every_combination(tmp_path):
    found = configurations_of(
        grid(
            tmp_path, CART_POLE + 'reward = ["hprs", "env"]\nend = ["paper", "released"]\nseeds = 3'
        )
    )
    named = [(c.reward, c.end, c.seed) for c in found]
    assert named == [
        ("hprs", "paper", 0), ("hprs", "paper", 1), ("hprs", "paper", 2),
        ("hprs", "released", 0), ("hprs", "released", 1), ("hprs", "released", 2),
        ("env", "paper", 0), ("env", "paper", 1), ("env", "paper", 2),
    ]  # fmt: skip


def test_a_block_says_what_the_defaults_do_not(tmp_path):
    text = "[defaults]\nseeds = [7]\nsteps = 1000\nset = { n_steps = 64 }\n" + CART_POLE
    shared, own = configurations_of(grid(tmp_path, text + CART_POLE + "steps = 2000\nseeds = [1]"))
    assert (shared.seed, shared.steps, shared.parameters["n_steps"]) == (7, 1000, 64)
    assert (own.seed, own.steps, own.parameters["n_steps"]) == (1, 2000, 64)


def test_what_two_blocks_ask_for_is_trained_once(tmp_path):
    text = CART_POLE + "seeds = 2\n" + CART_POLE + "seeds = [1, 2]"
    assert [c.seed for c in configurations_of(grid(tmp_path, text))] == [0, 1, 2]


def test_a_task_file_is_found_from_the_grid(tmp_path):
    (tmp_path / "mine.hprs").write_text(
        "const limit = 2\nsignal x = obs[0] in [-4.8, 4.8]\nensure near: abs(x) <= limit\n"
    )
    text = '[[runs]]\nenvironment = "CartPole-v1"\ntask = "mine.hprs"\nconst = { limit = 1 }'
    (found,) = configurations_of(grid(tmp_path, text))
    assert found.task.bounds["near"] == (1 - 4.8, 1.0)


def test_each_reward_takes_the_options_that_it_has(tmp_path):
    text = CART_POLE + 'reward = ["bhnr", "env"]\nreward_set = { window = 50 }'
    bhnr, env = configurations_of(grid(tmp_path, text))
    assert (bhnr.reward_options, env.reward_options) == ({"window": 50}, {})


def test_the_papers_grid_is_its_study():
    found = configurations_of(read_grid(GRIDS / "paper.toml"))
    assert len(found) == 5 * 6 * 10
    assert sum(c.steps for c in found) == 510_000_000
    assert {(c.algorithm, c.trainer) for c in found} == {("sac", "jax")}
    assert {c.parameters["ent_coef"] for c in found} == {"auto"}
    assert {c.parameters["gamma"] for c in found if c.reward == "tltl"} == {1.0}


@pytest.mark.parametrize("name", ["quick", "laptop"])
def test_the_grids_of_the_examples_are_right(name):
    assert configurations_of(read_grid(GRIDS / f"{name}.toml"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "it needs a block: [[runs]] on a line of its own."),
        ("runs = 3", "it needs a block"),
        ("[[run]]", "unknown key 'run'. Did you mean 'runs'?"),
        ("[[runs]]\nseeds = 2", "block 1: it names no environment."),
        (CART_POLE + "rewards = 2", "block 1: unknown key 'rewards'. Did you mean 'reward'?"),
        (CART_POLE + "zzz = 2", "block 1: unknown key 'zzz'. It may hold environment, reward, end"),
        (CART_POLE + "seeds = 0", "block 1: 'seeds' must be how many, from 1 on, or a list"),
        (CART_POLE + "seeds = [1, 1]", "block 1: 'seeds' must be how many"),
        (CART_POLE + "seeds = true", "block 1: 'seeds' must be how many"),
        (CART_POLE + "seeds = [-1]", "block 1: 'seeds' must be how many"),
        (CART_POLE + "steps = 1.5", "block 1: 'steps' must be a whole number from 1 on, got 1.5."),
        (CART_POLE + "reward = []", "block 1: 'reward' must be a name or a list of names"),
        (CART_POLE + "set = 3", "block 1: 'set' must be a table, as in { gamma = 0.99 }, got 3."),
        (CART_POLE + "task = 3", "block 1: 'task' must be a text in quotes, got 3."),
        (CART_POLE + "reward_set = { windw = 1 }", "block 1: none of its rewards has the option"),
        ("[defaults]\nsteps = 0\n" + CART_POLE, "defaults: 'steps' must be a whole number"),
        ("defaults = 1\n" + CART_POLE, "defaults must be a table"),
        ("[[runs]", "it is no TOML"),
    ],
)
def test_mistakes_are_explained(tmp_path, text, message):
    with pytest.raises(GridError) as caught:
        grid(tmp_path, text)
    assert str(caught.value).startswith(f"{tmp_path / 'grid.toml'}: {message}")


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('reward = "hpr"', "unknown reward 'hpr'"),
        ('end = "papr"', "unknown end 'papr'"),
        ('algorithm = "ppoo"', "unknown algorithm 'ppoo'"),
        ("set = { gama = 0.9 }", ""),
        ('task = "gone.hprs"', "there is no task file"),
    ],
)
def test_what_training_refuses_names_its_block(tmp_path, line, message):
    with pytest.raises(GridError) as caught:
        configurations_of(grid(tmp_path, CART_POLE + line))
    place = f"{tmp_path / 'grid.toml'}: block 1, hprs/CartPole-v0, "
    assert str(caught.value).startswith(place)
    assert message in str(caught.value)


def test_a_file_that_is_not_there_is_a_wrong_call(tmp_path):
    (tmp_path / "quick.toml").touch()
    with pytest.raises(UsageError, match=r"there is no grid .*quik.toml'. Did you mean 'quick"):
        read_grid(tmp_path / "quik.toml")
