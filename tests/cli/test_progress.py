import io

from rich.console import Console

from hprs.cli.progress import TrainingProgress, _clock
from hprs.envs import task_text_of
from hprs.semantics.assessment import Summary
from hprs.training.configuration import Configuration

ID = "hprs/CartPole-v0"
CONFIGURATION = Configuration(ID, task_text_of(ID), "ppo", {"gamma": 0.99}, steps=1000, seed=4)
SUMMARY = Summary(0.9, 0.5, 0.4, 1.25, {}, 10)


def watch(*, terminal, seeds=1):
    text = io.StringIO()
    console = Console(file=text, force_terminal=terminal, width=120)
    progress = TrainingProgress(console, seeds=seeds)
    progress.started(CONFIGURATION, 100)
    progress.advanced(500)
    progress.evaluated(500, SUMMARY)
    progress.stopping()
    progress.ended()
    return text.getvalue()


def test_a_file_gets_one_line_an_evaluation():
    lines = watch(terminal=False).splitlines()
    assert lines[0] == "hprs/CartPole-v0, hprs reward, ppo, 1,000 steps, from step 100"
    assert lines[1].startswith("step       500  PAM 1.25  S 0.90  S+T 0.50  ")
    assert lines[1].endswith(" left")
    assert "Ctrl-C again stops now" in lines[2]
    assert len(lines) == 3


def test_the_lines_of_several_seeds_say_which():
    assert all(
        line.startswith("seed 4  ") for line in watch(terminal=False, seeds=2).splitlines()[:2]
    )


def test_a_terminal_gets_a_bar_with_what_matters():
    text = watch(terminal=True)
    assert "seed 4" in text
    assert "500/1,000 steps" in text
    assert "PAM 1.25  S 0.90  S+T 0.50" in text


def test_the_time_left_is_a_clock():
    assert [_clock(seconds) for seconds in (0, 61.4, 3725)] == ["0:00", "1:01", "1:02:05"]
