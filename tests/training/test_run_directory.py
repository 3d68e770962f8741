import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from hprs.envs import task_of, task_text_of
from hprs.errors import RunError
from hprs.training import evaluation_table
from hprs.training.checkpoint import Checkpoint, Progress
from hprs.training.configuration import Configuration
from hprs.training.environment import make_environment
from hprs.training.evaluation import evaluate
from hprs.training.evaluation_table import columns, format_rows
from hprs.training.policies import ConstantPolicy
from hprs.training.provenance import versions
from hprs.training.run_directory import (
    RunDirectory,
    create_runs,
    find_runs,
    folder_of,
)

ID = "hprs/CartPole-v0"
CONFIGURATION = Configuration(
    environment=ID,
    task_text=task_text_of(ID),
    algorithm="ppo",
    parameters={"gamma": 0.99},
    steps=1000,
)


@pytest.fixture
def run(tmp_path):
    return create_runs([CONFIGURATION], tmp_path)[0]


@pytest.fixture
def episodes():
    return evaluate(lambda: make_environment(ID, task_of(ID)), ConstantPolicy(1), [4, 5])


def test_a_run_lies_where_its_configuration_says(run, tmp_path):
    folder = tmp_path / "hprs-CartPole-v0" / f"hprs-ppo-{CONFIGURATION.digest}"
    assert run.path == folder / "seed-0"
    assert len(CONFIGURATION.digest) == 8
    int(CONFIGURATION.digest, 16)


def test_a_run_describes_itself(run):
    content = json.loads((run.path / "run.json").read_text())
    assert RunDirectory(run.path).configuration == CONFIGURATION
    assert content["configuration"]["task_text"] == task_text_of(ID)
    assert len(content["task"]["requirements"]) == 5
    assert {"python", "numpy", "gymnasium", "hprs"} <= set(content["versions"])
    assert {"cores", "system", "processor"} <= set(content["machine"])
    assert "commit" in content


def test_the_digest_covers_what_changes_numbers_and_not_the_seed():
    assert replace(CONFIGURATION, seed=1).digest == CONFIGURATION.digest
    for change in (
        {"reward": "sparse"},
        {"end": "released"},
        {"steps": 2000},
        {"parameters": {"gamma": 0.9}},
        {"horizon": 100},
        {"environment_options": {"gravity": 9.0}},
        {"task_text": CONFIGURATION.task_text.replace("mark = 1.0", "mark = -1.0")},
    ):
        assert replace(CONFIGURATION, **change).digest != CONFIGURATION.digest


def test_a_comment_in_the_task_does_not_change_the_digest():
    text = CONFIGURATION.task_text + "\n# nothing new\n"
    assert replace(CONFIGURATION, task_text=text).digest == CONFIGURATION.digest


def test_an_existing_run_is_refused_with_a_hint(run, episodes, tmp_path):
    save(run, episodes, 0)
    with pytest.raises(
        RunError, match=f"exists already. Go on with it: hprs train --resume {run.path}"
    ):
        create_runs([CONFIGURATION], tmp_path)


def test_no_seed_is_created_if_one_of_them_has_begun(run, episodes, tmp_path):
    save(run, episodes, 0)
    with pytest.raises(RunError, match=r"exists already"):
        create_runs([replace(CONFIGURATION, seed=seed) for seed in (1, 0)], tmp_path)
    assert not (run.path.parent / "seed-1").exists()


def test_seeds_that_a_killed_process_made_and_did_not_begin_are_taken_over(run, tmp_path):
    runs = create_runs([replace(CONFIGURATION, seed=seed) for seed in range(3)], tmp_path)
    assert runs[0] == run
    assert find_runs(run.path.parent) == runs


MAKES_RUNS_SLOWLY = """
import sys, time
from dataclasses import replace
from pathlib import Path
from hprs.errors import RunError
from hprs.training import files
from hprs.training.run_directory import create_runs
from tests.training.test_run_directory import CONFIGURATION

write = files.write
files.write = lambda *args: (write(*args), time.sleep(0.02))
print("ready", flush=True)
sys.stdin.readline()
try:
    create_runs([replace(CONFIGURATION, seed=seed) for seed in range(4)], Path(sys.argv[1]))
except RunError as error:
    sys.exit(3 if "is being trained by another process (" in str(error) else 4)
"""


def test_two_processes_that_make_the_same_runs_at_once_do_not_disturb_each_other(tmp_path):
    children = [
        subprocess.Popen(
            [sys.executable, "-c", MAKES_RUNS_SLOWLY, str(tmp_path)], text=True,
            cwd=Path(__file__).parents[2], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )
        for _ in range(2)
    ]  # fmt: skip
    for child in children:
        assert child.stdout.readline() == "ready\n"
    for child in children:
        child.stdin.write("go\n")
        child.stdin.flush()
    codes = sorted(child.wait() for child in children)
    for child in children:
        child.stdin.close()
        child.stdout.close()
    assert codes in ([0, 0], [0, 3])
    assert len(find_runs(folder_of(CONFIGURATION, tmp_path))) == 4


def test_a_run_that_begins_while_another_process_makes_it_is_not_touched(
    run, episodes, tmp_path, monkeypatch
):
    header = evaluation_table.header

    def meanwhile(task):
        if not run.has_begun:
            save(run, episodes, 0)
        return header(task)

    monkeypatch.setattr(evaluation_table, "header", meanwhile)
    with pytest.raises(RunError, match=r"exists already"):
        create_runs([CONFIGURATION], tmp_path)
    assert len(run.evaluations()) == 2


def test_a_module_in_an_environment_id_stays_one_folder(tmp_path):
    folder = folder_of(replace(CONFIGURATION, environment="pkg.mod:ns/Env-v0"), tmp_path)
    assert folder.parent == tmp_path / "pkg.mod-ns-Env-v0"


def save(run, episodes, step, **progress):
    rows = format_rows(CONFIGURATION.task, step, episodes)
    checkpoint = Checkpoint(Progress(step=step, evaluated=step, **progress), rows, {"a": b"1"})
    run.save(checkpoint, evaluated=True)
    return checkpoint


def test_evaluations_have_one_row_an_episode_and_one_column_a_requirement(run, episodes):
    save(run, episodes, 0)
    save(run, episodes[:1], 100)
    lines = (run.path / "evaluations.csv").read_text().splitlines()
    assert lines[0] == (
        "step,seed,length,return,pam,safe,target,ensure.on_track,ensure.pole_up,"
        "conquer.parked,encourage.upright,encourage.slow"
    )
    assert [line.split(",")[:2] for line in lines[1:]] == [["0", "4"], ["0", "5"], ["100", "4"]]
    found = run.evaluations()[0]
    assert found["length"] == episodes[0].assessment.length
    assert found["return"] == episodes[0].total
    assert found["pam"] == episodes[0].assessment.pam
    assert found["safe"] == found["ensure.pole_up"] == 0.0
    assert found["encourage.slow"] == episodes[0].assessment.requirements["slow"]
    assert list(found) == columns(CONFIGURATION.task)


def test_a_checkpoint_comes_back_as_it_was(run, episodes):
    saved = save(run, episodes, 100, next_evaluation=200, best_pam=0.1, best_step=100)
    assert RunDirectory(run.path).checkpoint() == saved


@pytest.mark.parametrize("left", ["", "100,4,1", "100,4,9,0.0,0.0,0,0,1,0,0,0.0,0.0\n100,5"])
def test_opening_a_run_adds_the_rows_that_a_kill_kept_from_the_table(run, episodes, left):
    save(run, episodes, 0)
    table = run.path / "evaluations.csv"
    before = table.read_text()
    save(run, episodes, 100)
    after = table.read_text()
    table.write_text(before + left)
    run.open()
    assert table.read_text() == after
    run.open()
    assert table.read_text() == after


def test_a_run_that_has_not_begun_has_no_checkpoint(run):
    assert run.open() is None
    assert not run.has_begun


@pytest.mark.parametrize("left", ["rows", "half a row", "policy"])
def test_a_run_whose_checkpoint_is_gone_is_refused_and_keeps_everything(run, episodes, left):
    table = run.path / "evaluations.csv"
    header = table.read_text()
    save(run, episodes, 0)
    run.save_policy("last", trainer="sb3", step=0, name="policy.zip", data=b"network")
    shutil.rmtree(run.path / "checkpoint")
    if left != "policy":
        shutil.rmtree(run.path / "policy")
    if left != "rows":
        table.write_text(header + ("0,4,1" if left == "half a row" else ""))
    before = {file: file.read_bytes() for file in run.path.rglob("*") if file.is_file()}
    with pytest.raises(RunError) as error:
        run.open()
    assert str(error.value) == (
        f"{run.path / 'checkpoint'} is missing. This training cannot go on; its evaluations and "
        f"policies are untouched (hprs evaluate {run.path}). To train anew, choose another folder "
        "with --out."
    )
    assert {file: file.read_bytes() for file in before} == before


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda lines: [*lines[:2], "0,5,oops\n", *lines[3:]], "is damaged: line 3 is no row. Put back a copy of the file, or delete that line."),
        (lambda lines: [*lines[:2], "0,5\n", *lines[3:]], "is damaged: line 3 is no row."),
        (lambda lines: [*lines[:2], "\0\0\n", *lines[3:]], "is damaged: line 3 is no row."),
        (lambda lines: lines[1:], "is damaged: line 1 is no header. Put back a copy of it. To train anew, choose"),
        (lambda lines: [lines[0][:60]], "is damaged: line 1 is no header."),
        (lambda lines: [], "is damaged: line 1 is no header."),
        (None, "is missing. Put back a copy of it. To train anew, choose another folder with --out."),
    ],
)  # fmt: skip
def test_a_damaged_table_is_one_line_that_says_what_to_do(run, episodes, change, message):
    save(run, episodes, 0)
    save(run, episodes, 100)
    table = run.path / "evaluations.csv"
    if change is None:
        table.unlink()
    else:
        table.write_text("".join(change(table.read_text().splitlines(keepends=True))))
    for use in (run.evaluations, run.open):
        with pytest.raises(RunError) as error:
            use()
        assert str(error.value).startswith(f"{table} {message}")


def test_rows_that_are_gone_are_noticed(run, episodes):
    run = rewrite(run, evaluation_episodes=2)
    save(run, episodes, 0, evaluations=1)
    save(run, episodes, 100, evaluations=2)
    table, heard = run.path / "evaluations.csv", []
    run.open(heard.append)
    assert heard == []
    lines = table.read_text().splitlines(keepends=True)
    table.write_text("".join([lines[0], *lines[2:]]))
    run.open(heard.append)
    assert heard == [f"{table} is not what was recorded: it has 3 of 4 rows."]


def test_a_policy_is_kept_and_checked(run):
    run.save_policy("best", trainer="sb3", step=7, name="policy.zip", data=b"network")
    assert run.policy_file("best").read_bytes() == b"network"
    assert run.policy_step("best") == 7
    run.policy_file("best").write_bytes(b"networc")
    with pytest.raises(RunError, match=r"policy.zip is damaged"):
        run.policy_file("best")


def test_a_run_is_found_by_itself_or_among_its_seeds(tmp_path):
    runs = create_runs([replace(CONFIGURATION, seed=seed) for seed in (0, 10, 2)], tmp_path)
    assert find_runs(runs[1].path) == [runs[1]]
    assert [run.configuration.seed for run in find_runs(runs[0].path.parent)] == [0, 2, 10]


def test_what_is_not_a_run_is_said(run, tmp_path):
    with pytest.raises(RunError, match=r"there is no run '.*seed-9'. Did you mean 'seed-0'"):
        find_runs(run.path.parent / "seed-9")
    with pytest.raises(RunError, match=r"is not a run: it holds no run.json. There are runs in "):
        find_runs(tmp_path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(RunError, match=r"is not a run: it holds no run.json.$"):
        find_runs(tmp_path / "empty")


def test_runs_of_different_configurations_are_not_pooled(run):
    other = replace(CONFIGURATION, seed=1, reward="sparse")
    moved = create_runs([other], run.path.parent / "elsewhere")[0]
    moved.path.rename(run.path.parent / "seed-1")
    with pytest.raises(RunError, match=r"differ in more than the seed"):
        find_runs(run.path.parent)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "cannot be read"),
        ("[]", "is of format None, written by another version of hprs"),
        ('{"format": 0}', "is of format 0, written by another version of hprs"),
        (
            '{"format": 9, "versions": {"hprs": "7.0"}}',
            r"is of format 9, written by hprs 7.0; this hprs reads formats 1 to 3. Use it with hprs 7.0",
        ),
        (
            json.dumps({"format": 9, "versions": versions(), "commit": "abc123"}),
            rf"written by hprs {versions()['hprs']} \(commit abc123\); this hprs reads formats",
        ),
        ('{"format": 2}', "cannot be used"),
        ('{"format": 2, "configuration": {"seed": 0}}', "written by another version of hprs"),
    ],
)
def test_a_broken_run_file_is_said(run, text, message):
    (run.path / "run.json").write_text(text)
    with pytest.raises(RunError, match=message):
        _ = RunDirectory(run.path).configuration


def rewrite(run, format=3, versions=None, **changes):
    file = run.path / "run.json"
    content = json.loads(file.read_text())
    content["configuration"] |= changes
    if format == 1:
        del content["configuration"]["environment_options"]
    file.write_text(json.dumps(content | {"format": format, "versions": versions or {}}))
    return RunDirectory(run.path)


@pytest.mark.parametrize("has_checkpoint", [True, False])
@pytest.mark.parametrize("number", [1, 2])
def test_a_run_of_an_older_format_can_be_read_and_not_be_gone_on_with(
    run, episodes, number, has_checkpoint
):
    save(run, episodes, 0)
    if not has_checkpoint:
        shutil.rmtree(run.path / "checkpoint")
    old = rewrite(run, number, {"hprs": "0.0.9"})
    assert old.configuration == CONFIGURATION
    assert len(old.evaluations()) == 2
    with pytest.raises(
        RunError, match=rf"written by hprs 0.0.9 in format {number}, whose checkpoints"
    ):
        old.open()


def test_what_a_process_left_that_died_while_it_made_a_run_is_taken_over(run, tmp_path):
    (run.path / "run.json").unlink()
    assert create_runs([CONFIGURATION], tmp_path) == [run]
    assert run.configuration == CONFIGURATION


def test_a_missing_policy_is_said(run):
    with pytest.raises(RunError, match=r"has no best policy yet"):
        run.policy("best")
