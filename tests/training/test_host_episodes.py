"""The logs of many environments are those of each alone."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import TransformObservation

from hprs.spec.parser import parse_task
from hprs.training import episode_log
from hprs.training.episode_log import EpisodeLog
from hprs.training.host import SingleEnvironments, episodes
from hprs.wrappers.single import wrap

from ..probes import Slider, slider_task

TASK = parse_task("signal x = obs[0] in [-1, 1]\nencourage small: abs(x) <= 0.5")
ACTIONS = np.random.default_rng(0).uniform(-1, 1, (400, 3, 1))


def sliders():
    return [wrap(Slider(), slider_task("conquer")) for _ in range(3)]


def host_of(environments):
    host = SingleEnvironments(environments)
    host.reset(2)
    return host


def states(host):
    """What a host keeps of each environment: JSON, and actions."""
    state = host.state()
    return [(state["episodes"][row], state[f"actions {row}"].tolist()) for row in range(3)]


@pytest.mark.parametrize("steps", [0, 1, 63, 64, 65, 200])
def test_logs_are_those_of_single_environments(steps):
    host, alone = host_of(sliders()), []
    for row, environment in enumerate(sliders()):
        log = EpisodeLog(TransformObservation(environment, np.float32, None))
        log.reset(seed=host.state()["episodes"][row]["start"]["seed"])
        alone.append(log)
    for actions in ACTIONS[:steps]:
        host.step(actions)
        for log, action in zip(alone, actions, strict=True):
            _, _, terminated, truncated, _ = log.step(action)
            if terminated or truncated:
                log.reset()
    singly = [log.state() for log in alone]
    assert states(host) == [(state.to_json(), state.actions.tolist()) for state in singly]


def test_what_came_back_comes_back_again():
    first = host_of(sliders())
    for actions in ACTIONS[:130]:
        first.step(actions)
    for steps in (130, 133, 260, 399):
        second = SingleEnvironments(sliders())
        assert second.restore(first.state()) == []
        assert states(second) == states(first)
        for actions in ACTIONS[steps : steps + 3]:
            first.step(actions)
            second.step(actions)
        assert states(second) == states(first)
        first = second


class Endless(gym.Env):
    observation_space = gym.spaces.Box(-1, 1, (1,))
    action_space = gym.spaces.Box(-1, 1, (1,))

    def __init__(self, seeded):
        self.seeded = seeded

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed if self.seeded else None)
        return np.zeros(1, np.float32), {}

    def step(self, action):
        return np.zeros(1, np.float32), 0.0, False, False, {}


def endless(*seeded):
    return [wrap(Endless(each), TASK) for each in seeded]


def test_what_cannot_come_back_begins_anew_and_memory_is_bounded(monkeypatch):
    monkeypatch.setattr(episode_log, "LONGEST", 20)
    monkeypatch.setattr(episodes, "LONGEST", 20)
    host = host_of(endless(True, False))
    for _ in range(20):
        host.step(np.zeros((2, 1)))
    nothing = "its environment has no random generator of Gymnasium's"
    assert SingleEnvironments(endless(True, False)).restore(host.state()) == [nothing]
    for _ in range(200):
        host.step(np.zeros((2, 1)))
        assert len(host._logs._actions) <= 20 + 64
    other = SingleEnvironments(endless(True, False))
    assert other.restore(host.state()) == ["it is longer than 20 steps", nothing]
    other.step(np.zeros((2, 1)))
    assert other.state()["episodes"][0]["lost"] == ""
