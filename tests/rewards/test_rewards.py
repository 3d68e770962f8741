"""What every reward pays, episode by episode, on floats, NumPy, JAX and PyTorch."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import torch

from hprs import make_reward, parse_task
from hprs.envs.registration import BENCHMARKS
from hprs.errors import UsageError
from hprs.rewards import (
    ENDS,
    REWARDS,
    EpisodeAssessment,
    EpisodeRobustness,
    Hierarchical,
    RankPreserving,
    RequirementVector,
    Scalarized,
    StateReward,
    WindowRobustness,
    components_of,
    demands_of,
    environment_reward,
    safety_cost,
    sparse,
)
from hprs.rewards.base import Demands
from hprs.spec.task import Task
from tests.rewards.episodes import LINE, options_of, rollout
from tests.semantics.random_tasks import random_signals, random_task

STEPS = 12


def episodes(seed: int) -> tuple[Task, dict[str, Any], np.ndarray, np.ndarray]:
    task = random_task(seed, target=("achieve", "conquer")[seed % 2], depth=2, preferences=seed % 3)
    trace = random_signals(seed, task, (STEPS, 8))
    return (
        task,
        trace,
        task.potential(trace),
        rollout(sparse(task), trace, terminated=True, truncated=False),
    )


def discounted(rewards: np.ndarray, discount: float) -> np.ndarray:
    return np.tensordot(discount ** np.arange(len(rewards)), rewards, 1)


@pytest.mark.parametrize("terminated", [True, False])
@pytest.mark.parametrize("seed", range(30))
def test_undiscounted_paper_shaping_is_the_difference_of_the_ends(
    seed: int, terminated: bool
) -> None:
    task, trace, psi, base = episodes(seed)
    paid = rollout(Hierarchical(task), trace, terminated=terminated, truncated=not terminated)
    np.testing.assert_allclose((paid - base).sum(0), psi[-1] - psi[0], atol=1e-12)


@pytest.mark.parametrize("discount", [0.9, 0.99, 1.0])
@pytest.mark.parametrize("seed", range(20))
def test_discounted_invariant_shaping_depends_on_the_ends_alone(seed: int, discount: float) -> None:
    task, trace, psi, base = episodes(seed)
    reward = Hierarchical(task, "invariant", discount)
    ended = rollout(reward, trace, terminated=True, truncated=False) - base
    np.testing.assert_allclose(discounted(ended, discount), -psi[0], atol=1e-12)
    # A truncated episode goes on in its value, so its last potential stays.
    cut = rollout(reward, trace, terminated=False, truncated=True) - base
    expected = discount ** (STEPS - 1) * psi[-1] - psi[0]
    np.testing.assert_allclose(discounted(cut, discount), expected, atol=1e-12)
    both = rollout(reward, trace, terminated=True, truncated=True) - base
    np.testing.assert_allclose(both, ended)


@pytest.mark.parametrize(("terminated", "truncated"), [(True, False), (False, True), (True, True)])
@pytest.mark.parametrize("seed", range(10))
def test_released_drops_shaping_on_the_last_transition(
    seed: int, terminated: bool, truncated: bool
) -> None:
    task, trace, psi, base = episodes(seed)
    paid = rollout(
        Hierarchical(task, "released"), trace, terminated=terminated, truncated=truncated
    )
    np.testing.assert_allclose(paid[-1], base[-1])
    np.testing.assert_allclose((paid - base).sum(0), psi[-2] - psi[0], atol=1e-12)


def test_conventions_by_hand() -> None:
    # x = 0.4, 0.6, 0.8: scores of `there` are 1 - 0.4/0.8 = 0.5, 0.75, 1; Psi = 1.5, 1.75, 2.
    trace = {"x": [0.4, 0.6, 0.8]}
    ended = dict(terminated=True, truncated=False)
    assert rollout(Hierarchical(LINE), trace, **ended) == pytest.approx([0.25, 1 + 0.25])
    assert rollout(Hierarchical(LINE, "released"), trace, **ended) == pytest.approx([0.25, 1.0])
    # 0.9 * 1.75 - 1.5 = 0.075, and 1 + 0.9 * 0 - 1.75 = -0.75
    assert rollout(Hierarchical(LINE, "invariant", 0.9), trace, **ended) == pytest.approx(
        [0.075, -0.75]
    )
    assert rollout(sparse(LINE), trace, **ended) == pytest.approx([0.0, 1.0])


def test_sparse_pays_in_every_state_that_meets_the_target_safe_or_not() -> None:
    trace = {"x": [0.9, 0.5, 0.8, 1.0, 0.7]}
    paid = rollout(sparse(LINE), trace, terminated=False, truncated=False)
    assert paid.tolist() == [0.0, 1.0, 1.0, 0.0]


def test_without_a_target_the_base_reward_is_zero() -> None:
    task = parse_task("signal x in [0, 1]\nensure low: x <= 0.9")
    assert sparse(task).step(None, {"x": 0.5}, True, False) == (None, 0.0)
    assert sparse(task).step(None, {"x": np.ones(2)}, True, False)[1].tolist() == [0.0, 0.0]


def test_env_passes_the_environments_own_reward() -> None:
    reward = environment_reward(LINE)
    assert reward.init({"x": 0.0, "env_reward": 0.0}) is None
    assert reward.step(None, {"x": 0.0, "env_reward": -3.5}, False, False) == (None, -3.5)


@pytest.mark.parametrize("end", ENDS)
def test_floats_numpy_jax_and_pytorch_are_paid_the_same(end: Any) -> None:
    """Each environment of a batch ends at another step, for one reason or the other."""
    reward = Hierarchical(LINE, end, 0.9)
    rng = np.random.default_rng(5)
    x = rng.uniform(size=(STEPS, 6))
    terminated, truncated = rng.uniform(size=(2, STEPS, 6)) < 0.3

    def whole(convert: Any) -> np.ndarray:
        memory, paid = reward.init({"x": convert(x[0])}), []
        for t in range(1, STEPS):
            memory, value = reward.step(
                memory, {"x": convert(x[t])}, convert(terminated[t]), convert(truncated[t])
            )
            paid.append(np.asarray(value))
        return np.asarray(paid)

    expected = whole(np.asarray)
    np.testing.assert_allclose(whole(torch.asarray), expected)
    for i in range(6):
        alone = whole(lambda row, i=i: row[i].item())
        np.testing.assert_allclose(alone, expected[:, i])

    @jax.jit
    def scanned(x: Any, terminated: Any, truncated: Any) -> Any:
        def step(memory: Any, now: Any) -> Any:
            return reward.step(memory, {"x": now[0]}, now[1], now[2])

        return jax.lax.scan(step, reward.init({"x": x[0]}), (x[1:], terminated[1:], truncated[1:]))[
            1
        ]

    arrays = (jnp.asarray(x, jnp.float32), jnp.asarray(terminated), jnp.asarray(truncated))
    np.testing.assert_allclose(scanned(*arrays), expected, atol=1e-6)


@pytest.mark.parametrize("name", REWARDS)
def test_every_reward_runs_in_one_scan(name: str) -> None:
    reward = make_reward(name, LINE, horizon=100, **options_of(name, LINE))
    x = jnp.linspace(0.0, 1.0, 8)
    signals = {"x": x, "env_reward": x}
    flags = jnp.zeros(8, bool)
    first = {key: value[0] for key, value in signals.items()}
    _, paid = jax.lax.scan(
        lambda memory, now: reward.step(memory, now, False, False), reward.init(first), signals
    )
    _, again = jax.lax.scan(
        lambda memory, now: reward.step(memory, now[0], now[1], now[1]),
        reward.init(first),
        (signals, flags),
    )
    assert paid.shape[:1] == (8,)
    np.testing.assert_allclose(paid, again)


def test_rewards_by_name() -> None:
    assert make_reward("hprs", LINE) == Hierarchical(LINE, "paper")
    assert make_reward("hprs", LINE, end="invariant", discount=1) == Hierarchical(
        LINE, "invariant", 1
    )
    assert make_reward("sparse", LINE) == sparse(LINE)
    assert make_reward("env", LINE) == environment_reward(LINE)
    assert sparse(LINE).init({"x": 0.0}) is None
    ablation = make_reward("hprs-no-comfort", LINE, end="released")
    assert ablation == Hierarchical(LINE, "released", comfort=False)
    assert make_reward("morl", LINE, weights=[1, 2]) == Scalarized(LINE, (1.0, 2.0))
    assert make_reward("morl-uniform", LINE) == Scalarized(LINE, (0.5, 0.5))
    assert make_reward("morl-decreasing", LINE) == Scalarized(LINE, (2 / 3, 1 / 3))
    assert make_reward("tltl", LINE, margins="raw") == EpisodeRobustness(LINE, "raw")
    assert make_reward("bhnr", LINE, window=7) == WindowRobustness(LINE, 7)
    assert make_reward("rank-preserving", LINE, base=3) == RankPreserving(LINE, 3)
    assert make_reward("pam", LINE) == EpisodeAssessment(LINE)
    assert make_reward("vector", LINE, form="score") == RequirementVector(LINE, "score")


@pytest.mark.parametrize("benchmark", BENCHMARKS.values(), ids=list(BENCHMARKS))
def test_every_reward_can_be_made_of_every_benchmark(benchmark: Any) -> None:
    task = benchmark.task
    lengths = {signal.name: signal.length for signal in task.signals}
    state: dict[str, Any] = {"env_reward": 0.5}
    for name, bounds in task.ranges.items():
        middle = (bounds.low + bounds.high) / 2
        length = lengths.get(name)
        state[name] = middle if length is None else np.full(length, middle)
    for name in REWARDS:
        reward = make_reward(name, task, horizon=benchmark.horizon, **options_of(name, task))
        memory = reward.init(state)
        for ends in ((False, False), (False, True), (True, False)):
            memory, paid = reward.step(memory, state, *ends)
            assert np.all(np.isfinite(paid))


@pytest.mark.parametrize(("horizon", "window"), [(500, 25), (39, 1), (7, 1), (100_000, 5000)])
def test_the_window_of_bhnr_is_a_twentieth_of_the_horizon(horizon: int, window: int) -> None:
    assert make_reward("bhnr", LINE, horizon=horizon) == WindowRobustness(LINE, window)
    assert make_reward("bhnr", LINE, horizon=horizon, window=horizon).window == horizon


def test_what_is_paid_at_the_horizon_asks_for_no_discount_and_no_bootstrapping() -> None:
    asks = {
        name: demands_of(make_reward(name, LINE, horizon=100, **options_of(name, LINE)))
        for name in REWARDS
    }
    episodic = {"tltl", "rank-preserving", "pam"}
    for name, demands in asks.items():
        wanted = Demands(discount=1.0, horizon_is_terminal=True) if name in episodic else Demands()
        assert demands == wanted == REWARDS[name].demands


@pytest.mark.parametrize("name", REWARDS)
def test_a_reward_is_shaped_where_the_end_of_an_episode_matters_to_it(name: str) -> None:
    options = options_of(name, LINE)
    ends = [make_reward(name, LINE, horizon=100, end=e, discount=0.9, **options) for e in ENDS]
    assert REWARDS[name].shaped == any(other != ends[0] for other in ends)


def test_only_the_vector_pays_several_numbers() -> None:
    assert components_of(make_reward("vector", LINE)) == ("low", "there")
    assert components_of(make_reward("tltl", LINE)) is None
    # A reward of one's own need say nothing.
    own = StateReward(LINE, lambda task, signals: signals["x"])
    assert (components_of(own), demands_of(own)) == (None, Demands())


def test_the_safety_cost_counts_violated_safety_requirements() -> None:
    task = parse_task(
        "signal x in [0, 4]\nensure a: x <= 1\nensure b: x <= 2\nencourage c: x <= 0.5"
    )
    cost = safety_cost(task)
    assert cost.init({"x": 0.0}) is None
    paid = [cost.step(None, {"x": x}, False, False)[1] for x in (0.75, 1.5, 3.0)]
    assert paid == [0.0, 1.0, 2.0]
    for convert in (np.asarray, jnp.asarray, torch.asarray):
        batch = {"x": convert(np.array([0.75, 1.5, 3.0]))}
        assert cost.step(None, batch, False, False)[1].tolist() == paid


def test_the_ablation_by_hand() -> None:
    # x = 0, 2, 3: scores of `goal` 1/4, 3/4, 1; of `calm` 1, 1/3, 0.
    task = parse_task(
        "signal x in [-1, 4]\nensure low: x <= 3\nachieve goal: x >= 3\nencourage calm: x <= 1"
    )
    trace = {"x": [0.0, 2.0, 3.0]}
    ended = dict(terminated=True, truncated=False)
    # With comfort Psi is 1 + 1/4 * 2, 1 + 3/4 * (1 + 2/3), 1 + 1 * (1 + 1/3).
    assert rollout(Hierarchical(task), trace, **ended) == pytest.approx([0.75, 1 + 1 / 12])
    without = Hierarchical(task, comfort=False)
    assert rollout(without, trace, **ended) == pytest.approx([0.5, 1 + 0.25])


def test_without_comfort_nothing_is_left_of_a_task_of_comfort_alone() -> None:
    task = parse_task("signal x in [0, 1]\nencourage low: x <= 0.5")
    reward = Hierarchical(task, comfort=False)
    assert reward.init({"x": 0.25}) == 0.0
    assert reward.step(0.0, {"x": 0.5}, False, False) == (0.0, 0.0)
    assert reward.init({"x": np.ones(2)}).tolist() == [0.0, 0.0]


BAD_REWARDS = [
    ("hpsr", {}, r"unknown reward 'hpsr'; choose one of hprs, .*\. Did you mean 'hprs'\?"),
    ("hprs", {"end": "papper"}, r"unknown end 'papper'; choose one of .* Did you mean 'paper'\?"),
    ("hprs", {"end": "invariant"}, r"end='invariant' needs the learner's discount"),
    ("hprs", {"end": "invariant", "discount": 1.1}, r"discount must lie in \(0, 1\], got 1\.1"),
    ("hprs", {"end": "invariant", "discount": 0.0}, r"discount must lie in \(0, 1\], got 0\.0"),
    ("hprs", {"discount": -1.0}, r"discount must lie in \(0, 1\], got -1\.0"),
    ("hprs", {"end": "invariant", "discount": float("nan")}, r"discount must lie in .* got nan"),
    ("hprs", {"weights": [1, 1]}, r"the reward hprs has no option 'weights'\. It has none\."),
    ("tltl", {"margin": "raw"}, r"no option 'margin'\. Did you mean 'margins'\?"),
    ("tltl", {"end": "invariant"}, r"end='invariant' needs the learner's discount"),
    ("rank-preserving", {"weights": 1}, r"no option 'weights'\. It has base, margins\."),
    (
        "morl",
        {},
        r"^the reward morl needs the option weights: one number for each of low, there\.$",
    ),
    (
        "bhnr",
        {},
        r"^the reward bhnr needs the option window: a number of states, because the horizon .* is not known here\.$",
    ),
    ("bhnr", {"horizon": 10, "window": 11}, r"window must be at most the horizon of 10 .* got 11"),
    *[
        (name, {"horizon": horizon}, rf"^the horizon is a whole .* from 1 on, got {horizon!r}\.$")
        for name in ("bhnr", "hprs")
        for horizon in (0, -1, 500.0, float("nan"), True, "500")
    ],
]


@pytest.mark.parametrize(("name", "options", "message"), BAD_REWARDS)
def test_rewards_that_do_not_exist(name: str, options: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        make_reward(name, LINE, **options)
