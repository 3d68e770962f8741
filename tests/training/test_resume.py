"""A training that was stopped, resumed, killed and resumed is the training that was not."""

import json
import signal
from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from hprs.training import episode_log, sb3
from hprs.training.run_directory import RunDirectory, create_runs
from hprs.training.trainers import trainer_of

from .small import (
    CART_POLE,
    Interrupter,
    Killer,
    configure_sb3,
    jax_ppo,
    jax_sac,
    off_policy,
    ppo,
    same_numbers,
    table,
)


def trained(configuration, folder):
    [run] = create_runs([configuration], folder)
    assert trainer_of(configuration)(run)
    return run


def interrupted(configuration, folder, steps=(30, 70, 110, 150, 200)):
    """Stopped by Ctrl-C and by death in turn, and then trained to its end."""
    [run] = create_runs([configuration], folder)
    train = trainer_of(configuration)
    for count, step in enumerate(steps):
        if count % 2:
            with pytest.raises(MemoryError):
                train(run, Killer(step))
        else:
            assert not train(run, Interrupter(step))
    assert train(run)
    return run


CASES = {
    "ppo": lambda folder: ppo(),
    "ppo, schedules": lambda folder: ppo(
        settings={"learning_rate": "linear_0.01", "clip_range": "linear_0.3", "n_epochs": 1},
        steps=300,
    ),
    "ppo, gSDE, Box2D": lambda folder: ppo(
        "hprs/LunarLanderObstacle-v0", {"use_sde": True, "sde_sample_freq": 4}, steps=300
    ),
    "ppo, walker": lambda folder: ppo("hprs/BipedalWalker-v0", steps=300),
    "sac": off_policy,
    "sac, gSDE, several steps": lambda folder: off_policy(
        folder, "sac", {"use_sde": True, "n_steps": 3, "train_freq": 4}
    ),
    "sac, Box2D": lambda folder: configure_sb3(
        "hprs/LunarLanderObstacle-v0",
        algorithm="sac",
        settings={"environments": 2, "learning_starts": 40, "buffer_size": 150, "batch_size": 16,
                  "net_arch": [8]},
        horizon=60, steps=240, evaluation_interval=45, evaluation_episodes=1,
    ),
    "td3 with noise": lambda folder: off_policy(folder, "td3", {"action_noise": 0.2}),
    "a2c": lambda folder: configure_sb3(
        CART_POLE,
        algorithm="a2c",
        settings={"environments": 2, "net_arch": [8]},
        steps=300,
        evaluation_interval=90,
        evaluation_episodes=2,
    ),
    "dqn": lambda folder: configure_sb3(
        CART_POLE,
        algorithm="dqn",
        settings={"environments": 2, "net_arch": [8], "learning_starts": 20, "scale_reward": True,
                  "target_update_interval": 20},
        steps=300,
        evaluation_interval=90,
        evaluation_episodes=2,
    ),
    "jax ppo, device": partial(jax_ppo, device=True),
    "jax ppo, host": partial(jax_ppo, device=False),
    "jax sac, device": partial(jax_sac, device=True),
    "jax sac, host": partial(jax_sac, device=False),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_a_resumed_training_equals_the_uninterrupted_one_bit_for_bit(tmp_path, case):
    if "Box2D" in case or "walker" in case:
        pytest.importorskip("Box2D")
    configuration = CASES[case](tmp_path)
    whole = trained(configuration, tmp_path / "whole")
    pieces = interrupted(configuration, tmp_path / "pieces")
    assert len(whole.evaluations()) >= 6
    assert same_numbers(whole, pieces)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_either_signal_saves_the_state(tmp_path, number):
    [run] = create_runs([ppo()], tmp_path)
    before = signal.getsignal(number)
    listener = Interrupter(100, number)
    assert not sb3.train(run, listener)
    assert listener.asked == 1
    assert signal.getsignal(number) is before
    assert run.checkpoint().progress.step == 192


def test_a_kill_between_checkpoint_and_table_loses_no_row(tmp_path):
    [run] = create_runs([ppo()], tmp_path)
    assert not sb3.train(run, Interrupter(100))
    whole = table(run)
    lines = whole.splitlines(keepends=True)
    (run.path / "evaluations.csv").write_text("".join(lines[:-2]) + lines[-2][:9])
    assert not sb3.train(run, Interrupter(200))
    assert table(run).startswith(whole)


def test_a_kill_before_the_last_policies_are_kept_is_made_good(tmp_path):
    run = trained(ppo(), tmp_path)
    before = run.policy_file("last").read_bytes()
    (run.policy("last") / "policy.json").write_text('{"step": 1}')
    listener = Interrupter(0)
    assert sb3.train(run, listener)
    assert run.policy_file("last").read_bytes() == before
    assert json.loads((run.policy("last") / "policy.json").read_text())["step"] == 480
    assert listener.heard == [f"{run.path} is complete: 480 steps."]


class Moody(gym.Env):
    """Draws numbers where Gymnasium does not look."""

    observation_space = spaces.Box(-10.0, 10.0, (2,), np.float64)
    action_space = spaces.Discrete(2)

    def __init__(self, hidden=True):
        self.hidden = np.random.default_rng() if hidden else None

    def reset(self, *, seed=None, options=None):
        if self.hidden is not None:
            super().reset(seed=seed)
        self.steps = 0
        return self._observe(), {}

    def step(self, action):
        self.steps += 1
        return self._observe(), 0.0, False, False, {}

    def _observe(self):
        mood = 0.0 if self.hidden is None else self.hidden.uniform()
        return np.array([mood, self.steps])


@pytest.fixture
def moody():
    gym.register("Moody-v0", Moody, max_episode_steps=50)
    yield
    del gym.registry["Moody-v0"]


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({}, "the same actions led elsewhere"),
        ({"hidden": False}, "its environment has no random generator of Gymnasium's"),
    ],
)
@pytest.mark.parametrize("algorithm", ["ppo", "dqn"])
def test_an_episode_that_does_not_come_back_is_restarted_and_the_run_says_so(
    tmp_path, moody, algorithm, options, reason
):
    (tmp_path / "calm.hprs").write_text("signal x = obs[0] in [-1, 2]\nencourage calm: x <= 0.5\n")
    settings = {"environments": 2, "net_arch": [8], "scale_reward": True}
    if algorithm == "ppo":
        settings |= {"n_steps": 40, "batch_size": 40}
    else:
        settings |= {"learning_starts": 10, "n_steps": 3}
    configuration = configure_sb3(
        "Moody-v0", task_path=str(tmp_path / "calm.hprs"), algorithm=algorithm, settings=settings,
        environment_options=options, steps=300, evaluation_interval=300, evaluation_episodes=1,
    )  # fmt: skip
    [run] = create_runs([configuration], tmp_path)
    assert not sb3.train(run, Interrupter(70))
    listener = Interrupter(180)
    assert not sb3.train(run, listener)
    assert listener.heard == [
        f"2 of 2 environments begin a new episode: {reason}. "
        "The numbers will not be those of an uninterrupted training."
    ]
    assert sb3.train(run)
    assert sorted({row["step"] for row in run.evaluations()})[0] == 0


def test_an_episode_whose_actions_are_too_many_is_restarted(tmp_path, monkeypatch):
    monkeypatch.setattr(episode_log, "LONGEST", 5)
    [run] = create_runs([ppo()], tmp_path)
    assert not sb3.train(run, Interrupter(100))
    listener = Interrupter(200)
    assert not sb3.train(run, listener)
    assert "it is longer than 5 steps" in listener.heard[0]


def test_a_training_that_goes_on_with_other_versions_says_so(tmp_path):
    [run] = create_runs([ppo()], tmp_path)
    assert not sb3.train(run, Interrupter(100))
    file = run.path / "run.json"
    content = json.loads(file.read_text())
    now, content["versions"]["torch"] = content["versions"]["torch"], "1.0"
    file.write_text(json.dumps(content))
    listener = Interrupter(200)
    assert not sb3.train(RunDirectory(run.path), listener)
    assert listener.heard == [
        f"{run.path} was begun with torch 1.0 (now {now}). "
        "The numbers may not be those of an uninterrupted training."
    ]


class Picture(gym.Env):
    """A noisy picture; with `hidden`, of a noise that Gymnasium does not know."""

    observation_space = spaces.Box(0, 255, (36, 36, 3), np.uint8)
    action_space = spaces.Discrete(2)

    def __init__(self, hidden=False):
        self.hidden = np.random.default_rng() if hidden else None

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self._observe(), {}

    def step(self, action):
        return self._observe(), 0.0, False, False, {}

    def _observe(self):
        return (self.hidden or self.np_random).integers(0, 256, (36, 36, 3), np.uint8)


@pytest.mark.parametrize("hidden", [False, True])
def test_a_training_on_pictures_resumes(tmp_path, hidden):
    gym.register("Picture-v0", Picture, max_episode_steps=7)
    (tmp_path / "red.hprs").write_text("signal x = action in [0, 1]\nencourage left: x <= 0.5\n")
    try:
        configuration = configure_sb3(
            "Picture-v0", task_path=str(tmp_path / "red.hprs"), environment_options={"hidden": hidden},
            settings={"environments": 2, "n_steps": 5, "batch_size": 10, "n_epochs": 1, "net_arch": [4],
                      "policy_kwargs": {"features_extractor_kwargs": {"features_dim": 8}}},
            steps=60, evaluation_interval=20, evaluation_episodes=1,
        )  # fmt: skip
        whole = trained(configuration, tmp_path / "whole")
        pieces = interrupted(configuration, tmp_path / "pieces", steps=(8, 22, 32))
        assert hidden or same_numbers(whole, pieces)
    finally:
        del gym.registry["Picture-v0"]


@pytest.mark.parametrize("call", [0, 1, 3])
def test_ctrl_c_during_an_evaluation_changes_no_number(tmp_path, monkeypatch, call):
    from hprs.training.sb3 import recorder

    calls, evaluate = 0, recorder.evaluate

    def interrupting(*arguments):
        nonlocal calls
        calls += 1
        if calls == call + 1:
            signal.raise_signal(signal.SIGINT)
        return evaluate(*arguments)

    whole = trained(ppo(), tmp_path / "whole")
    [run] = create_runs([ppo()], tmp_path / "pieces")
    monkeypatch.setattr(recorder, "evaluate", interrupting)
    assert not sb3.train(run)
    assert sb3.train(run)
    assert same_numbers(whole, run)
