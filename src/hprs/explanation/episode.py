"""Plays an episode, and records its signals and pictures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hprs.errors import UsageError
from hprs.explanation.explanation import LONGEST
from hprs.explanation.film import PAGE, Film, Stock
from hprs.semantics.evaluation import Signals
from hprs.semantics.plan import plan_of
from hprs.spec.task import Task
from hprs.training.policies import Policy
from hprs.wrappers.single import TaskWrapper, wrap

RENDER_MODE = "rgb_array"


@dataclass(frozen=True, eq=False)
class Recording:
    """An episode as it was played."""

    trace: Mapping[str, Any]
    """Signal name to values over time, s_0 first."""
    film: Film
    rate: float | None
    """Steps a second, as the environment states them."""


class _Recorder:
    """A reward that pays nothing and remembers the signals that a task reads."""

    def __init__(self, task: Task) -> None:
        self._names = plan_of(task).signals
        self.states: list[list[Any]] = []

    def init(self, signals: Signals) -> None:
        self.states = [[signals[name] for name in self._names]]

    def step(
        self, memory: None, signals: Signals, terminated: Any, truncated: Any
    ) -> tuple[None, float]:
        self.states.append([signals[name] for name in self._names])
        return None, 0.0

    def trace(self) -> dict[str, Any]:
        columns = zip(*self.states, strict=True)
        return {name: np.array(values) for name, values in zip(self._names, columns, strict=True)}


def record(
    make: Callable[..., TaskWrapper], policy: Policy, seed: int, stock: Stock = PAGE
) -> Recording:
    """Play one episode.

    Args:
        make: Makes the environment with its task; takes `render_mode` where it draws pictures.
        policy: What to run.
        seed: Seed of the environment's reset.
        stock: How large and how many pictures are kept.

    Raises:
        PolicyError: The policy fails, or its action is none of the environment's.
        UsageError: The episode has more than `LONGEST` states.
    """
    made, film = _drawing(make, stock)
    recorder = _Recorder(made.task)
    environment = wrap(made.env, made.task, recorder)
    try:
        observation, _ = environment.reset(seed=seed)
        _take(environment, film, 0)
        step, ended = 0, False
        while not ended:
            observation, _, terminated, truncated, _ = environment.step(policy(observation))
            step, ended = step + 1, terminated or truncated
            if step >= LONGEST:
                raise UsageError(f"the episode has more than {LONGEST:,} states; set --horizon.")
            if ended or film.wants(step):
                _take(environment, film, step)
    finally:
        environment.close()
    return Recording(recorder.trace(), film, environment.metadata.get("render_fps"))


def _drawing(make: Callable[..., TaskWrapper], stock: Stock) -> tuple[TaskWrapper, Film]:
    """The environment, with pictures where it can draw them."""
    made = make()
    if RENDER_MODE not in (made.metadata.get("render_modes") or ()):
        return made, Film(trouble="the environment draws none.")
    made.close()
    return make(render_mode=RENDER_MODE), Film(stock)


def _take(environment: TaskWrapper, film: Film, step: int) -> None:
    if film.trouble:
        return
    try:
        picture: Any = environment.render()
    except Exception as error:  # noqa: BLE001
        # Drivers, displays and packages of others fail in ways of their own, and the numbers of an
        # episode are worth having without its pictures. The page and the terminal say why.
        film.trouble = " ".join(f"{type(error).__name__}: {error}".split())
        return
    if not isinstance(picture, np.ndarray) or picture.ndim != 3:
        film.trouble = f"the environment drew a {type(picture).__name__}."
        return
    film.add(step, picture)
