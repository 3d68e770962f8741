import io
from dataclasses import replace

from rich.console import Console

from hprs.cli.population_progress import PopulationProgress, labels
from hprs.cli.progress import Pace, TrainingProgress, beginning, clock
from hprs.envs import task_text_of
from hprs.semantics.assessment import Summary
from hprs.training.configuration import Configuration
from hprs.training.configure import configure
from hprs.training.population import Outcome
from hprs.training.run_directory import create_runs

ID = "hprs/CartPole-v0"
CONFIGURATION = Configuration(ID, task_text_of(ID), "ppo", {"gamma": 0.99}, steps=1000, seed=4)
SUMMARY = Summary(0.9, 0.5, 0.4, 1.25, {}, 10)


def watch(*, terminal):
    text = io.StringIO()
    console = Console(file=text, force_terminal=terminal, width=120)
    progress = TrainingProgress(console)
    progress.started(CONFIGURATION, 100)
    progress.advanced(300)
    progress.advanced(500)
    progress.evaluated(500, SUMMARY)
    progress.stopping()
    progress.ended()
    return text.getvalue()


def test_a_file_gets_one_line_an_evaluation():
    lines = watch(terminal=False).splitlines()
    assert lines[0] == "hprs/CartPole-v0, hprs reward, ppo, 1,000 steps, from step 100"
    assert lines[1].startswith("step       500  PAM 1.25  S 0.90  S+T 0.50")
    assert lines[1].endswith(" left")
    assert "Ctrl-C again stops now" in lines[2]
    assert len(lines) == 3


def test_a_terminal_gets_a_bar_with_what_matters():
    text = watch(terminal=True)
    assert "seed 4" in text
    assert "500/1,000 steps" in text
    assert "PAM 1.25  S 0.90  S+T 0.50" in text


def test_the_time_left_is_aclock():
    assert [clock(seconds) for seconds in (0, 61.4, 3725)] == ["0:00", "1:01", "1:02:05"]


def watch_several(folder, *, terminal):
    """Two members side by side; the second fails, the third was complete."""
    text = io.StringIO()
    console = Console(file=text, force_terminal=terminal, width=140)
    runs = create_runs([replace(CONFIGURATION, seed=seed) for seed in range(3)], folder)
    with PopulationProgress(console, runs, workers=2) as progress:
        first, second = progress.member(runs[0]), progress.member(runs[1])
        first.started(CONFIGURATION, 0)
        second.started(CONFIGURATION, 100)
        first.advanced(300)
        first.advanced(500)
        first.evaluated(500, SUMMARY)
        if progress.bar is not None:
            progress.bar.refresh()
        first.ended()
        progress.settled(Outcome(runs[0], "complete"))
        progress.settled(Outcome(runs[1], "failed", "it diverged."))
        progress.member(runs[2]).noticed("is complete.")
        progress.settled(Outcome(runs[2], "complete"))
        progress.stopping()
    return text.getvalue()


def test_a_file_gets_one_line_an_evaluation_of_each_member(tmp_path):
    lines = watch_several(tmp_path, terminal=False).splitlines()
    assert lines[0] == "hprs/CartPole-v0, ppo: 3 runs on 2 processes, 3,000 steps"
    assert lines[1] == "seed 1  from step 100"
    assert lines[2].startswith("seed 0  step       500  PAM 1.25  S 0.90  S+T 0.50")
    assert lines[2].endswith(" left")
    assert lines[3] == "seed 1  failed: it diverged."
    assert lines[4] == "seed 2  is complete."
    assert "Ctrl-C again stops now" in lines[5]
    assert len(lines) == 6


def test_a_terminal_gets_a_bar_a_member_and_one_for_all(tmp_path):
    text = watch_several(tmp_path, terminal=True)
    assert "seed 0" in text
    assert "500/1,000 steps" in text
    assert "PAM 1.25  S 0.90  S+T 0.50" in text
    # The last drawing: the third was complete before, the second has made no step of its 900.
    assert "3 of 3 runs" in text
    assert "1,600/3,000 steps" in text


def test_a_run_that_was_interrupted_is_not_counted(tmp_path):
    text = io.StringIO()
    console = Console(file=text, force_terminal=True, width=140)
    runs = create_runs([replace(CONFIGURATION, seed=seed) for seed in range(2)], tmp_path)
    with PopulationProgress(console, runs, workers=2) as progress:
        for run in runs:
            progress.member(run)
        progress.settled(Outcome(runs[0], "complete"))
        progress.settled(Outcome(runs[1], "interrupted"))
    assert "1 of 2 runs" in text.getvalue()
    assert "2 of 2 runs" not in text.getvalue()


def test_a_label_says_what_tells_a_member_from_the_others():
    seeds = [replace(CONFIGURATION, seed=seed) for seed in (0, 1)]
    assert labels(seeds) == ["seed 0", "seed 1"]
    others = [
        CONFIGURATION,
        replace(CONFIGURATION, end="released"),
        replace(CONFIGURATION, reward="env"),
    ]
    assert labels(others) == ["hprs paper", "hprs released", "env"]
    steps = [CONFIGURATION, replace(CONFIGURATION, steps=7)]
    assert labels(steps) == [f"{found.digest} " for found in steps]


def test_what_comes_before_the_first_steps_makes_no_pace(monkeypatch):
    """Compilation takes longer than thousands of steps: a pace with it in would tell of hours."""
    now = 100.0
    monkeypatch.setattr("hprs.cli.progress.time.monotonic", lambda: now)
    pace = Pace()
    assert pace.rate(2_000) == 0.0
    now = 102.0
    assert pace.rate(2_000) == 0.0
    assert pace.rate(42_000) == 20_000.0


def test_the_jax_trainer_says_that_it_compiles():
    jax = configure("hprs/CartPole-v0", steps=10)
    sb3 = configure("hprs/CartPole-v0", steps=10, trainer="sb3")
    assert beginning(jax) == "compiling (kept for the next time)"
    assert beginning(sb3) == ""
