import json
import sys

import gymnasium as gym
import pytest
from gymnasium.envs.classic_control import Continuous_MountainCarEnv

from hprs.envs import BENCHMARKS
from hprs.errors import MissingExtraError, UsageError
from hprs.rewards import REWARDS
from hprs.training.configuration import OFTEN, SELDOM, Configuration
from hprs.training.configure import configure
from hprs.training.ppo.settings import HYPERPARAMETERS, Settings
from hprs.training.run_directory import RunDirectory, create_runs
from tests.training.small import MOUNTAIN, configure_sb3


class Named(gym.ObservationWrapper):
    """Mountain car whose observation is a dictionary."""

    def __init__(self, render_mode=None):
        super().__init__(Continuous_MountainCarEnv(render_mode))
        self.observation_space = gym.spaces.Dict({"position": gym.spaces.Box(-2, 2, (1,))})

    def observation(self, observation):
        return {"position": observation[:1]}


CART_POLE, LANDER = "hprs/CartPole-v0", "hprs/LunarLanderObstacle-v0"


@pytest.mark.parametrize("environment", BENCHMARKS)
def test_ppo_of_the_jax_trainer_trains_every_benchmark(environment):
    found = configure(environment)
    assert (found.trainer, found.algorithm) == ("jax", "ppo")
    assert found.parameters.keys() == HYPERPARAMETERS.keys()
    settings = Settings.of(found.parameters)
    assert settings.rollout % settings.batch_size == 0


def test_another_algorithm_is_trained_by_who_has_it(tmp_path):
    task = tmp_path / "mountain.hprs"
    task.write_text(MOUNTAIN)
    found = configure("MountainCarContinuous-v0", task_path=str(task), algorithm="td3")
    assert (found.trainer, found.algorithm) == ("sb3", "td3")
    found = configure(CART_POLE, trainer="sb3")
    assert (found.trainer, found.algorithm) == ("sb3", "ppo")
    assert "threads" in found.parameters


def test_the_trainer_is_part_of_the_hash_and_older_runs_keep_theirs(tmp_path):
    ours, theirs = configure(CART_POLE, steps=100), configure_sb3(CART_POLE, steps=100)
    assert ours.digest != theirs.digest
    [run] = create_runs([theirs], tmp_path)
    content = json.loads((run.path / "run.json").read_text())
    assert content["configuration"].pop("trainer") == "sb3"
    (run.path / "run.json").write_text(json.dumps(content))
    old = RunDirectory(run.path).configuration
    assert old == theirs
    assert run.path.parent.name.endswith(old.digest)
    # The digest of a run that was made before there were trainers.
    before = Configuration(CART_POLE, BENCHMARKS[CART_POLE].task_text, "ppo", {"gamma": 0.99}, 1000)
    assert before.digest == "47a5f192"


@pytest.mark.parametrize(("package", "trainer"), [("jax", "jax"), ("optax", "jax"), ("stable_baselines3", "sb3")])  # fmt: skip
def test_a_trainer_that_is_not_installed_says_how_to_get_it(monkeypatch, package, trainer):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingExtraError, match=rf"pip install 'hprs\[{trainer}\]'$"):
        configure(CART_POLE, trainer=trainer)


def test_the_jax_trainer_evaluates_often_at_first_and_then_seldom():
    found = configure(CART_POLE, steps=5000)
    assert found.evaluation_interval == 50
    assert configure(CART_POLE, steps=20).evaluation_interval == 1
    assert configure(CART_POLE, steps=5000, evaluation_interval=7).evaluation_interval == 7
    assert [found.interval_after(n) for n in (1, OFTEN - 1, OFTEN)] == [50, 50, 50 * SELDOM]


@pytest.mark.parametrize(
    ("steps", "interval"), [(5_000, 50), (1_000_000, 10_000), (2_000_000, 10_000)]
)
def test_sac_is_evaluated_every_hundredth_and_every_10_000_steps_at_least(steps, interval):
    found = configure(LANDER, algorithm="sac", steps=steps)
    assert [found.interval_after(n) for n in (1, OFTEN, 10 * OFTEN)] == [interval] * 3


def test_sac_in_jax_refuses_a_number_of_updates_that_is_none():
    with pytest.raises(
        UsageError, match="takes a gradient_steps from 1 on, got -1: name the number"
    ):
        configure(LANDER, algorithm="sac", settings={"gradient_steps": -1})


def test_the_other_trainer_evaluates_at_one_interval():
    found = configure_sb3(CART_POLE, steps=5000)
    assert [found.interval_after(n) for n in (1, OFTEN, 10 * OFTEN)] == [10_000] * 3


def test_a_reward_without_shaping_is_trained_in_one_way_whatever_the_end():
    assert configure(CART_POLE, reward="env", end="released") == configure(CART_POLE, reward="env")
    ends = {configure(CART_POLE, end=end).digest for end in ("paper", "invariant", "released")}
    assert len(ends) == 3
    with pytest.raises(UsageError, match=r"unknown end 'papper'"):
        configure(CART_POLE, reward="env", end="papper")


@pytest.mark.parametrize("name", REWARDS)
def test_a_reward_paid_at_the_horizon_is_learned_without_a_discount(name):
    if name in ("vector", "morl"):
        return
    parameters = configure(CART_POLE, reward=name).parameters
    episodic = name in ("tltl", "pam", "rank-preserving")
    assert (parameters["gamma"] == 1.0, parameters["horizon_is_terminal"]) == (episodic, episodic)


def test_spaces_that_only_the_other_trainer_handles_are_refused_with_its_name(tmp_path):
    gym.register("Named-v0", Named, max_episode_steps=10)
    task = tmp_path / "named.hprs"
    task.write_text("signal p = obs.position[0] in [-1.2, 0.6]\nachieve top: p >= 0.45\n")
    try:
        with pytest.raises(UsageError) as error:
            configure("Named-v0", task_path=str(task))
        assert str(error.value) == (
            "ppo of the trainer jax cannot handle observations of a Dict space; "
            "that of sb3 can: --trainer sb3."
        )
        assert configure_sb3("Named-v0", task_path=str(task)).trainer == "sb3"
    finally:
        del gym.registry["Named-v0"]
