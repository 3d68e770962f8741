import json
import os
import signal
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import torch

from hprs.errors import SignalError, SpecError, UsageError
from hprs.training import sb3
from hprs.training.environment import make_configured
from hprs.training.evaluation import evaluate, training_seeds
from hprs.training.listener import Silence
from hprs.training.run_directory import RunDirectory, create_runs
from hprs.training.sb3.model import make_vector
from hprs.training.sb3.policy import stack
from tests.training.small import configure_sb3

CART_POLE = "hprs/CartPole-v0"
SMALL = {"environments": 2, "n_steps": 32, "batch_size": 32, "n_epochs": 1, "net_arch": [8]}

MOUNTAIN = """
signal position = obs[0] in [-1.2, 0.6] "m"
signal velocity = obs[1] in [-0.07, 0.07]
achieve top: position >= 0.45
encourage gentle: abs(velocity) <= 0.05
"""


@pytest.fixture
def mountain(tmp_path):
    file = tmp_path / "mountain.hprs"
    file.write_text(MOUNTAIN)
    return str(file)


def ppo(**options):
    arguments = {"steps": 192, "evaluation_interval": 64, "evaluation_episodes": 2} | options
    return configure_sb3(CART_POLE, settings=SMALL, **arguments)


def sac(mountain, **options):
    settings = {"learning_starts": 20, "buffer_size": 5000, "net_arch": [8], "batch_size": 16}
    return configure_sb3(
        "MountainCarContinuous-v0",
        algorithm="sac",
        task_path=mountain,
        settings=settings,
        horizon=40,
        steps=120,
        evaluation_interval=60,
        evaluation_episodes=2,
        **options,
    )


class Interrupter(Silence):
    """Sends a signal after a number of steps, as Ctrl-C would."""

    def __init__(self, step):
        self.step, self.asked = step, 0

    def advanced(self, step):
        if step >= self.step and not self.asked:
            os.kill(os.getpid(), signal.SIGINT)

    def stopping(self):
        self.asked += 1


class Killer(Silence):
    """Dies when an evaluation has been recorded."""

    def __init__(self, step):
        self.step = step

    def advanced(self, step):
        if step >= self.step:
            raise MemoryError


def rows(run):
    return (run.path / "evaluations.csv").read_text().splitlines()


def steps(run):
    return [int(row["step"]) for row in run.evaluations()]


def test_ppo_writes_a_complete_run_directory(tmp_path):
    [run] = create_runs([ppo()], tmp_path)
    assert sb3.train(run)
    assert steps(run) == [0, 0, 64, 64, 128, 128, 192, 192]
    seeds = [int(row["seed"]) for row in run.evaluations()]
    assert seeds == [seed for number in range(4) for seed in training_seeds(number, 2)]
    assert len(set(seeds)) == 8
    names = {file.name for file in run.path.iterdir()}
    assert {"run.json", "evaluations.csv", "checkpoint", "policy"} <= names
    assert json.loads((run.policy("last") / "policy.json").read_text())["step"] == 192
    assert run.checkpoint().progress.step == 192


def test_the_last_policy_is_the_one_that_was_evaluated(tmp_path):
    [run] = create_runs([ppo()], tmp_path)
    sb3.train(run)
    again = evaluate(
        lambda: make_configured(run.configuration),
        sb3.load_policy(run, "last"),
        training_seeds(3, 2),
    )
    recorded = run.evaluations()[-2:]
    assert [row["return"] for row in recorded] == [episode.total for episode in again]
    assert [row["pam"] for row in recorded] == [episode.assessment.pam for episode in again]


def test_the_best_policy_has_the_highest_mean_pam(tmp_path):
    [run] = create_runs([ppo()], tmp_path)
    sb3.train(run)
    found = run.evaluations()
    means = {
        step: np.mean([row["pam"] for row in found if row["step"] == step]) for step in steps(run)
    }
    best = json.loads((run.policy("best") / "policy.json").read_text())["step"]
    assert best == max(means, key=means.get)
    assert run.checkpoint().progress.best_pam == pytest.approx(max(means.values()))


def test_the_same_seed_gives_the_same_numbers_and_another_seed_others(tmp_path):
    runs = [create_runs([ppo(seed=seed)], tmp_path / str(i))[0] for i, seed in enumerate((0, 0, 1))]
    for run in runs:
        sb3.train(run)
    assert rows(runs[0]) == rows(runs[1])
    assert rows(runs[0])[1:] != rows(runs[2])[1:]


def test_sac_trains_on_an_environment_that_is_not_ours(tmp_path, mountain):
    configuration = sac(mountain)
    assert configuration.algorithm == "sac"
    assert configuration.parameters["ent_coef"] == "auto_0.02"
    [run] = create_runs([configuration], tmp_path)
    assert sb3.train(run)
    assert steps(run) == [0, 0, 60, 60, 120, 120]
    assert all(row["length"] == 40 for row in run.evaluations())
    assert [segment.stop for segment in run.checkpoint().segments] == [120]


@pytest.mark.parametrize("make", [lambda mountain: ppo(), sac], ids=["ppo", "sac"])
def test_an_interrupted_training_resumes_without_loss_or_doubles(tmp_path, mountain, make):
    configuration = make(mountain)
    [run] = create_runs([configuration], tmp_path)
    before = signal.getsignal(signal.SIGINT)
    listener = Interrupter(70)
    assert not sb3.train(run, listener)
    assert listener.asked == 1
    assert signal.getsignal(signal.SIGINT) is before
    written, stopped = rows(run), run.checkpoint().progress.step
    assert 70 <= stopped < configuration.steps
    assert sb3.train(run)
    assert rows(run)[: len(written)] == written
    assert sorted(set(steps(run))) == list(
        range(0, configuration.steps + 1, configuration.evaluation_interval)
    )
    assert len(steps(run)) == 2 * len(set(steps(run)))
    assert sb3.train(run), "a complete run has nothing left to do"


def test_a_killed_training_gets_the_policies_its_checkpoint_promises(tmp_path):
    [run] = create_runs([ppo(evaluation_interval=1000)], tmp_path)
    with pytest.raises(MemoryError):
        sb3.train(run, Killer(1))
    assert run.checkpoint().progress.best_step == 0
    (run.policy("best") / "policy.json").unlink()
    (run.policy("last") / "policy.json").unlink()
    sb3.train(run, Interrupter(1))
    assert (run.policy_step("best"), run.policy_step("last")) == (0, 0)


def test_tensorboard_gets_every_requirement(tmp_path):
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    [run] = create_runs([ppo()], tmp_path)
    sb3.train(run, Interrupter(70))
    sb3.train(run)
    events = EventAccumulator(str(run.path)).Reload()
    assert {
        "assessment/PAM",
        "assessment/S",
        "assessment/S+T",
        "requirement/on_track",
        "requirement/slow",
    } <= set(events.Tags()["scalars"])
    scalars = events.Scalars("assessment/PAM")
    assert [scalar.step for scalar in scalars] == [0, 64, 128, 192]


def test_training_leaves_pytorch_as_it_was(tmp_path):
    before = torch.get_num_threads()
    [run] = create_runs([ppo()], tmp_path)
    sb3.train(run)
    assert torch.get_num_threads() == before


def test_a_policy_acts_on_one_thread_and_leaves_pytorch_as_it_was(tmp_path, monkeypatch):
    [run] = create_runs([ppo()], tmp_path)
    sb3.train(run, Interrupter(1))
    policy = sb3.load_policy(run, "last")
    seen = []
    predict = policy.model.predict
    monkeypatch.setattr(
        policy.model,
        "predict",
        lambda *args, **kwargs: seen.append(torch.get_num_threads()) or predict(*args, **kwargs),
    )
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        policy(np.zeros(4, np.float32))
        assert (seen, torch.get_num_threads()) == ([1], 2)
    finally:
        torch.set_num_threads(before)


def test_invariant_shaping_shares_the_learners_discount():
    configuration = configure_sb3(CART_POLE, end="invariant", settings={"gamma": 0.9})
    assert make_configured(configuration).reward.discount == 0.9


def test_the_shaped_reward_reaches_the_learner(tmp_path):
    configuration = configure_sb3(CART_POLE, settings={"environments": 1, "scale_reward": False})
    vector = make_vector(configuration)
    vector.seed(3)
    vector.reset()
    single = make_configured(configuration)
    single.reset(seed=3)
    for _ in range(5):
        assert vector.step(np.array([1]))[1][0] == pytest.approx(single.step(1)[1], abs=1e-6)


@pytest.mark.parametrize(("reward", "terminal"), [("pam", True), ("sparse", False)])
def test_a_reward_paid_at_the_horizon_makes_it_the_end_for_the_learner(reward, terminal):
    """Stable-Baselines3 bootstraps where it is told that a time limit cut an episode."""
    settings = {"environments": 1, "scale_reward": False}
    configuration = configure_sb3(CART_POLE, reward=reward, settings=settings, horizon=2)
    vector = make_vector(configuration)
    vector.seed(3)
    vector.reset()
    vector.step(np.array([1]))
    _, rewards, done, [info] = vector.step(np.array([0]))
    assert done[0]
    assert info["TimeLimit.truncated"] is not terminal
    single = make_configured(configuration)
    single.reset(seed=3)
    single.step(1)
    _, paid, terminated, truncated, _ = single.step(0)
    assert (terminated, truncated) == (False, True), "the task's own wrapper tells them apart"
    assert rewards[0] == pytest.approx(paid)


def test_a_run_with_options_of_its_reward_is_resumed(tmp_path):
    configuration = ppo(reward="bhnr", reward_options={"window": 7, "form": "boolean"})
    [run] = create_runs([configuration], tmp_path)
    assert not sb3.train(run, Interrupter(64))
    again = RunDirectory(run.path)
    assert again.configuration == configuration
    assert sb3.train(again)
    assert make_configured(again.configuration).reward.window == 7


def test_runs_that_know_no_options_of_rewards_are_read_and_gone_on_with(tmp_path):
    [run] = create_runs([ppo()], tmp_path)
    content = json.loads((run.path / "run.json").read_text())
    del content["configuration"]["reward_options"]
    del content["configuration"]["parameters"]["horizon_is_terminal"]
    (run.path / "run.json").write_text(json.dumps(content))
    old = RunDirectory(run.path)
    assert old.configuration.digest == run.configuration.digest
    assert sb3.train(old)


def test_a_dictionary_of_observations_is_batched():
    seen = [{"a": np.zeros(2), "b": np.int64(1)}, {"a": np.ones(2), "b": np.int64(2)}]
    stacked = stack(seen)
    assert stacked["a"].shape == (2, 2)
    assert stacked["b"].tolist() == [1, 2]


@pytest.mark.parametrize("name", ["PPO", "A2C", "DQN", "SAC", "TD3"])
def test_any_file_of_stable_baselines3_is_a_policy(tmp_path, name):
    import stable_baselines3

    env = gym.make("CartPole-v1" if name in ("PPO", "A2C", "DQN") else "MountainCarContinuous-v0")
    model = getattr(stable_baselines3, name)("MlpPolicy", env, device="cpu")
    model.save(tmp_path / "policy.zip")
    policy = sb3.load_zip(tmp_path / "policy.zip")
    observation, _ = env.reset(seed=0)
    assert type(policy.model).__name__ == name
    assert np.array_equal(policy(observation), model.predict(observation, deterministic=True)[0])


def test_another_file_is_no_policy(tmp_path):
    (tmp_path / "x.zip").write_text("no")
    with pytest.raises(UsageError, match=r"is not a Stable-Baselines3 policy"):
        sb3.load_zip(tmp_path / "x.zip")
    with pytest.raises(UsageError, match=r"there is no policy file"):
        sb3.load_zip(tmp_path / "y.zip")


@pytest.mark.parametrize(
    ("options", "kind", "message"),
    [
        ({"environment": "hprs/CartPoel-v0"}, UsageError, "unknown environment 'hprs/CartPoel-v0'. Did you mean 'hprs/CartPole-v0'?"),
        ({"environment": "nowhere:Env-v0"}, UsageError, "unknown environment 'nowhere:Env-v0': there is no module 'nowhere'."),
        ({"environment": "CartPole-v1"}, UsageError, "'CartPole-v1' has no task of its own. Give it one: --task FILE.hprs"),
        ({"reward": "hrps"}, UsageError, "unknown reward 'hrps'"),
        ({"end": "papr"}, UsageError, "unknown end 'papr'; choose one of paper, invariant, released. Did you mean 'paper'?"),
        ({"algorithm": "sca"}, UsageError, "unknown algorithm 'sca'"),
        ({"steps": 0}, UsageError, "the steps must be at least 1, got 0."),
        ({"evaluation_episodes": 1_000_001}, UsageError, "an evaluation has at most 1,000,000 episodes."),
        ({"horizon": -1}, UsageError, "the horizon must be at least 1, got -1."),
        ({"settings": {"n_step": 3}}, UsageError, "ppo has no hyper-parameter 'n_step'. Did you mean 'n_steps'?"),
    ],
)  # fmt: skip
def test_a_wrong_training_is_refused_before_it_starts(options, kind, message):
    with pytest.raises(kind) as error:
        configure_sb3(**({"environment": CART_POLE} | options))
    assert str(error.value).startswith(message)


def test_a_task_that_does_not_fit_the_environment_is_refused(tmp_path, mountain):
    with pytest.raises(
        UsageError, match=r"there is no task file '.*mountan.hprs'. Did you mean 'mountain.hprs'"
    ):
        configure_sb3(CART_POLE, task_path=mountain.replace("mountain.", "mountan."))
    wrong = tmp_path / "wrong.hprs"
    wrong.write_text("signal x = obs[9] in [0, 1]\nensure low: x <= 0.5\n")
    with pytest.raises(SignalError, match=r"'x'"):
        configure_sb3(CART_POLE, task_path=str(wrong))
    wrong.write_text("# nothing\n")
    with pytest.raises(UsageError, match=r"wrong.hprs has no requirement: it asks nothing."):
        configure_sb3(CART_POLE, task_path=str(wrong))
    wrong.write_text("ensure\n")
    with pytest.raises(SpecError):
        configure_sb3(CART_POLE, task_path=str(wrong))


@pytest.mark.skipif(not Path("/dev/fd").exists(), reason="needs pipes with a name")
def test_a_task_is_read_once_so_that_it_may_come_through_a_pipe():
    text = "signal x = obs[0] in [-5, 5]\nensure near: abs(x) <= 2\n"
    reading, writing = os.pipe()
    os.write(writing, text.encode())
    os.close(writing)
    configuration = configure_sb3(CART_POLE, task_path=f"/dev/fd/{reading}")
    os.close(reading)
    assert configuration.task_text == text
    assert configuration.task.labels == ("near",)


def test_what_stable_baselines3_refuses_is_one_line(tmp_path):
    configuration = configure_sb3(CART_POLE, settings={"policy_kwargs": {"ortho": True}})
    [run] = create_runs([configuration], tmp_path)
    with pytest.raises(UsageError, match=r"Stable-Baselines3 refuses this training"):
        sb3.train(run)
