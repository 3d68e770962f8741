"""The paper's corollary, exactly: which conventions keep the optimal policies of finite MDPs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from hprs import parse_task
from hprs.rewards import Hierarchical, Reward, sparse
from hprs.semantics.assessment import achieved, is_safe, start
from hprs.semantics.evaluation import evaluate
from hprs.semantics.plan import plan_of
from hprs.spec.task import Task
from tests.semantics.random_tasks import random_signals, random_task

TIE = 1e-9


@dataclass(frozen=True)
class Problem:
    """A finite MDP whose states carry signals; an episode ends in the terminal states."""

    signals: dict[str, Any]
    terminal: np.ndarray
    transitions: np.ndarray
    """Probability by state, action and next state."""

    def rewards(self, reward: Reward) -> np.ndarray:
        """Reward by state and next state, from the reward's own functions."""
        memory = reward.init(self.signals)
        before = None if memory is None else memory[:, None]
        paid = reward.step(before, self.signals, self.terminal, np.zeros_like(self.terminal))[1]
        states = len(self.terminal)
        return np.broadcast_to(paid, (states, states))

    def optimal_actions(self, reward: Reward, discount: float) -> np.ndarray:
        """Truth value by state that is not terminal and action, by policy iteration."""
        expected = np.einsum("san,sn->sa", self.transitions, self.rewards(reward))
        onward = self.transitions * ~self.terminal
        states = np.arange(len(self.terminal))
        policy = np.zeros(len(states), int)
        for _ in range(1000):
            system = np.eye(len(states)) - discount * onward[states, policy]
            value = np.linalg.solve(system, expected[states, policy])
            quality = expected + discount * onward @ value
            best = quality.max(axis=1)
            if np.all(quality[states, policy] >= best - TIE / 100):
                return (quality >= best[:, None] - TIE)[~self.terminal]
            better = quality[states, policy] < best - TIE / 100
            policy = np.where(better, quality.argmax(axis=1), policy)
        raise AssertionError("policy iteration does not end")


def random_problem(seed: int, *, leak: float) -> tuple[Task, Problem]:
    """Every action reaches some terminal state with probability `leak` or more."""
    rng = np.random.default_rng(seed)
    states, actions = int(rng.integers(4, 9)), int(rng.integers(2, 4))
    for attempt in range(seed * 1000, seed * 1000 + 1000):
        task = random_task(
            attempt,
            target=("achieve", "conquer")[seed % 2],
            counts=(1 + seed % 2, seed % 3),
            depth=2,
            preferences=seed % 3,
        )
        plan = plan_of(task)
        if not plan.signals:
            continue
        signals = random_signals(attempt, task, (states,))
        found = evaluate(task, signals)
        tally = start(plan, found.satisfied)
        terminal = ~is_safe(tally) | achieved(plan, tally)
        rewarded = found.satisfied[plan.target_row]
        if 0 < terminal.sum() < states - 1 and rewarded.any() and np.ptp(found.potential) > 0.1:
            break
    else:
        raise AssertionError("no task has both kinds of states")
    # Few successors, so that actions differ and some tie.
    transitions = rng.dirichlet(np.full(states, 0.2), size=(states, actions))
    exits = terminal * rng.uniform(0.1, 1.0, size=(states, actions, states))
    transitions = (1 - leak) * transitions + leak * exits / exits.sum(-1, keepdims=True)
    return task, Problem(signals, terminal, transitions)


@pytest.mark.parametrize("seed", range(200))
def test_invariant_keeps_the_optimal_actions_of_every_state_discounted(seed: int) -> None:
    task, problem = random_problem(seed, leak=0.0)
    discount = (0.9, 0.99, 0.5)[seed % 3]
    base = problem.optimal_actions(sparse(task), discount)
    shaped = problem.optimal_actions(Hierarchical(task, "invariant", discount), discount)
    assert np.array_equal(base, shaped)


@pytest.mark.parametrize("seed", range(200))
def test_invariant_keeps_the_optimal_actions_of_every_state_undiscounted(seed: int) -> None:
    """Every policy is proper: each action leaks to a terminal state."""
    task, problem = random_problem(seed, leak=0.1)
    base = problem.optimal_actions(sparse(task), 1.0)
    shaped = problem.optimal_actions(Hierarchical(task, "invariant", 1.0), 1.0)
    assert np.array_equal(base, shaped)


@pytest.mark.parametrize("end", ["paper", "released"])
def test_the_other_conventions_change_optimal_actions_of_some_of_these_problems(end: Any) -> None:
    changed = 0
    for seed in range(40):
        task, problem = random_problem(seed, leak=0.1)
        base = problem.optimal_actions(sparse(task), 1.0)
        changed += not np.array_equal(base, problem.optimal_actions(Hierarchical(task, end), 1.0))
    assert changed > 0


GOAL = parse_task(
    """
    signal x  in [0, 1]
    signal v  in [0, 1]
    achieve   goal:   x >= 1
    encourage slow:   v <= 0
    encourage slower: v <= 0
    """
)


def choice(states: dict[str, list[float]], terminal: list[int], *moves: tuple[int, ...]) -> Problem:
    """A deterministic problem; `moves` are the next states by action of each state in turn."""
    number = len(states["x"])
    transitions = np.zeros((number, 2, number))
    for state in range(number):
        following = moves[state] if state < len(moves) else (state, state)
        for action in range(2):
            transitions[state, action, following[action % len(following)]] = 1.0
    ends = np.isin(np.arange(number), terminal)
    return Problem({name: np.asarray(v) for name, v in states.items()}, ends, transitions)


def test_smallest_counterexample_for_paper() -> None:
    """One step: the goal in a hurry, or an end just short of it in comfort."""
    # State 0 is the start, 1 the goal at full speed, 2 an end at 0.9 of the way, at rest.
    problem = choice({"x": [0.0, 1.0, 0.9], "v": [0.0, 1.0, 0.0]}, [1, 2], (1, 2))
    # Psi: 0; 1 + 1 * (0 + 0) = 1; 0.9 + 0.9 * (1 + 1) = 2.7
    np.testing.assert_allclose(GOAL.potential(problem.signals), [0.0, 1.0, 2.7])
    # Base reward: 1 against 0. With `paper`: 1 + 1 - 0 = 2 against 0 + 2.7 - 0.
    np.testing.assert_allclose(problem.rewards(Hierarchical(GOAL))[0, 1:], [2.0, 2.7])
    assert problem.optimal_actions(sparse(GOAL), 1.0).tolist() == [[True, False]]
    assert problem.optimal_actions(Hierarchical(GOAL), 1.0).tolist() == [[False, True]]
    # Both other conventions pay 1 against 0 here.
    for reward in (Hierarchical(GOAL, "released"), Hierarchical(GOAL, "invariant", 1.0)):
        np.testing.assert_allclose(problem.rewards(reward)[0, 1:], [1.0, 0.0])
        assert problem.optimal_actions(reward, 1.0).tolist() == [[True, False]]


def test_smallest_counterexample_for_released() -> None:
    """Two steps: the goal at once, or nearly there in comfort and then an end without it."""
    # State 1 is the goal, 2 lies at 0.9 of the way; from there every action ends in state 3.
    problem = choice(
        {"x": [0.0, 1.0, 0.9, 0.0], "v": [0.0, 1.0, 0.0, 1.0]}, [1, 3], (1, 2), (1,), (3,)
    )
    rewards = problem.rewards(Hierarchical(GOAL, "released"))
    # At once: 1. By way of state 2: 2.7 - 0, and 0 for the end, which takes nothing back.
    assert rewards[0, 1] == 1.0
    assert rewards[0, 2] == pytest.approx(2.7)
    assert rewards[2, 3] == 0.0
    assert problem.optimal_actions(sparse(GOAL), 1.0)[0].tolist() == [True, False]
    released = problem.optimal_actions(Hierarchical(GOAL, "released"), 1.0)
    assert released[0].tolist() == [False, True]
    # `paper` takes the 2.7 back (0.0 in the end), and so does `invariant`.
    for reward in (Hierarchical(GOAL), Hierarchical(GOAL, "invariant", 1.0)):
        assert problem.optimal_actions(reward, 1.0)[0].tolist() == [True, False]


def test_paper_is_not_invariant_under_a_discount_even_without_an_end() -> None:
    """For ever in the goal in a hurry, or short of it in comfort."""
    task = parse_task(
        """
        signal x  in [0, 1]
        signal v  in [0, 1]
        conquer   goal:    x >= 1
        encourage slow:    v <= 0
        encourage slower:  v <= 0
        encourage slowest: v <= 0
        """
    )
    problem = choice({"x": [0.0, 1.0, 0.9], "v": [0.0, 1.0, 0.0]}, [], (1, 2))
    # Psi: 0; 1; 0.9 * 4 = 3.6. Discount 0.5: `paper` pays 1 + 1 + (0.5 + 0.25 + ..) = 3 for the goal
    # and 3.6 for the other; the base reward pays 2 against 0.
    assert problem.optimal_actions(sparse(task), 0.5)[0].tolist() == [True, False]
    assert problem.optimal_actions(Hierarchical(task), 0.5)[0].tolist() == [False, True]
    kept = problem.optimal_actions(Hierarchical(task, "invariant", 0.5), 0.5)[0]
    assert kept.tolist() == [True, False]


def test_paper_keeps_the_optimum_where_all_ends_have_the_same_potential() -> None:
    """Undiscounted and proper: the shaping then adds the same to every policy."""
    task = parse_task("signal x in [0, 1]\nconquer goal: x >= 1")
    rng = np.random.default_rng(0)
    for _ in range(50):
        x = np.concatenate([rng.choice([0.2, 0.5, 1.0], size=6), [0.0, 0.0]])
        terminal = np.arange(8) >= 6
        transitions = rng.dirichlet(np.full(8, 0.3), size=(8, 3))
        transitions = 0.8 * transitions + 0.1 * terminal
        problem = Problem({"x": x}, terminal, transitions)
        base = problem.optimal_actions(sparse(task), 1.0)
        assert np.array_equal(base, problem.optimal_actions(Hierarchical(task), 1.0))
