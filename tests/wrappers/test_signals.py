"""What is read from `info` and from a user's function is named where it is wrong."""

from __future__ import annotations

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import hprs
from hprs.errors import SignalError
from hprs.wrappers.single import wrap
from hprs.wrappers.vector import wrap_vector
from tests.probes import Slider

REST = "\nconquer here: w <= 0"


class Supplying(Slider):
    """Puts entries into `info`, at reset or from the first step on."""

    def __init__(self, entries, from_step=0):
        super().__init__()
        self.entries, self.from_step = entries, from_step

    def reset(self, **arguments):
        observation, info = super().reset(**arguments)
        return observation, info | (self.entries if self.from_step == 0 else {})

    def step(self, action):
        *rest, info = super().step(action)
        return *rest, info | (self.entries if self.steps >= self.from_step else {})


def go(env, source, *, vector, signals=None):
    task = hprs.parse_task(f"signal w{source} in [-3, 3]{REST}")
    if vector:
        copies = SyncVectorEnv([lambda: env] * 2, autoreset_mode=AutoresetMode.SAME_STEP)
        wrapped, action = wrap_vector(copies, task, signals=signals), np.zeros((2, 1))
    else:
        wrapped, action = wrap(env, task, signals=signals), np.zeros(1)
    wrapped.reset(seed=0)
    wrapped.step(action)
    return wrapped


MISSHAPEN = [
    (
        {"start": np.zeros(2)},
        " = info.start[2]",
        r"'w' reads info.start\[2\], but info.start is .*",
    ),
    ({"k": 0.5}, " = info.k.z", r"'w' reads info.k.z, but info.k is .*, which has no entries"),
    ({"k": 0.5}, " = info.k.z initially 0", r"'w' reads info.k.z, but info.k is .* no entries"),
    ({"signals": np.ones(3)}, "", r"'w' reads info.signals.w, but info.signals is .* no entries"),
]


@pytest.mark.parametrize("vector", [False, True])
@pytest.mark.parametrize("from_step", [0, 1])
@pytest.mark.parametrize(("entries", "source", "message"), MISSHAPEN)
def test_misshapen_info_names_signal_path_and_what_was_found(
    vector, from_step, entries, source, message
):
    if from_step == 1 and "initially" not in source:
        source += " initially 0"
    with pytest.raises(SignalError, match=message):
        go(Supplying(entries, from_step), source, vector=vector)


def test_an_index_into_one_number_shows_the_number():
    with pytest.raises(SignalError, match=r"'w' reads info.start\[2\], but info.start is 1.5\."):
        go(Supplying({"start": 1.5}), " = info.start[2]", vector=False)
    with pytest.raises(SignalError, match=r"but info.start is \{'x': 1.5\}\."):
        go(Supplying({"start": {"x": 1.5}}), " = info.start[2]", vector=False)


def test_lists_in_info_are_indexed_as_arrays_are():
    assert go(Supplying({"start": [1.0, 2.0, 0.5]}), " = info.start[2]", vector=False)


@pytest.mark.parametrize("vector", [False, True])
def test_a_misspelt_info_path_with_an_initial_value_is_found_at_the_first_step(vector):
    env = Supplying({"start": 1.0}, from_step=1)
    task = hprs.parse_task(f"signal w = info.strt initially 0 in [-3, 3]{REST}")
    copies = [lambda: env]
    wrapped = wrap_vector(SyncVectorEnv(copies), task) if vector else wrap(env, task)
    wrapped.reset(seed=0)
    with pytest.raises(SignalError, match=r"'w' is missing"):
        wrapped.step(np.zeros((1, 1) if vector else 1))


class Later:
    """A signal function that is right at the probe and at reset, and returns this later."""

    def __init__(self, returned, value):
        self.returned, self.value, self.calls = returned, value, 0

    def __call__(self, observation, action, last_action, info):
        self.calls += 1
        return {"w": self.value} if self.calls <= 2 else self.returned


@pytest.mark.parametrize("vector", [False, True])
@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (None, "the function given as `signals` must return a dictionary .*, got None"),
        (3, "the function given as `signals` must return a dictionary .*, got 3"),
        ({}, r"signal 'w' is missing.*: neither the function given as `signals` nor"),
        ({"v": 1.0}, r"signal 'w' is missing.*: neither the function given as `signals` nor"),
    ],
)
def test_what_a_function_returns_later_is_checked_too(vector, returned, message):
    function = Later(returned, np.zeros(2) if vector else 0.0)
    with pytest.raises(SignalError, match=message):
        go(Slider(), "", vector=vector, signals=function)
    assert function.calls == 3


def test_a_function_that_omits_a_signal_at_reset_is_named():
    with pytest.raises(SignalError, match=r"missing at reset: neither the function given as"):
        go(Slider(), "", vector=False, signals=lambda *_: {})


def test_a_signal_that_a_function_omits_is_read_from_its_source():
    assert go(Slider(), " = obs[0]", vector=False, signals=lambda *_: {})
    assert go(Slider(), " = obs[0]", vector=True, signals=lambda *_: {})
