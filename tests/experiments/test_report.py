"""Reports of recorded runs: what is in their tables, files and page."""

import csv
import json
import re

import numpy as np
import pytest

from hprs.cli import main
from hprs.experiments import published
from hprs.experiments.groups import benchmarks
from hprs.experiments.recorded import PADDED, Shelf, find_below, read_all, read_run
from hprs.experiments.report import Section, best_run, recorded_means, warnings_of, write_report
from hprs.training import evaluation_table, files
from hprs.training.configure import configure
from hprs.training.run_directory import EVALUATIONS_FILE, RUN_FILE, create_runs

EPISODES = 10
FLOORS = {
    "doing nothing": {
        "S": 0.0, "S+T": 0.0, "S+T+C": 0.0, "PAM": 0.1, PADDED: 0.0, "ensure.on_track": 1.0,
        "ensure.pole_up": 0.0, "conquer.parked": 0.0, "encourage.upright": 0.5,
        "encourage.slow": 0.25,
    }
}  # fmt: skip


def recorded(out, reward="hprs", *, seeds=2, good=lambda seed: True, steps=3000, **more):
    """Synthetic runs: after 1,000 steps a good seed meets everything, with a comfort of 0.8."""
    configurations = [
        configure("hprs/CartPole-v0", reward=reward, steps=steps, seed=seed, **more)
        for seed in range(seeds)
    ]
    runs = create_runs(configurations, out)
    for run in runs:
        rows = [
            row(step, episode, good=step > 0 and good(run.configuration.seed))
            for step in (0, 1000, 2000, 3000)
            for episode in range(EPISODES)
        ]
        with (run.path / EVALUATIONS_FILE).open("a") as stream:
            stream.writelines(rows)
    return runs


def row(step, seed, *, good):
    if good:
        # PAM = 1 + 1/2 + comfort / 4.
        return f"{step},{seed},250,3.5,{1 + 0.5 + 0.8 / 4},1,1,1,1,1,0.9,0.7\n"
    return f"{step},{seed},20,0.1,0.1,0,0,1,0,0,0.5,0.25\n"


def section(out):
    found, troubles = read_all(find_below(out), Shelf(out / "none.npz"))
    assert not troubles
    [benchmark] = benchmarks(found)
    return Section(benchmark, recorded_means(benchmark), FLOORS, EPISODES)


def table(out, name, *, paper=False):
    [found] = [one for one in section(out).tables(paper=paper) if one.name == name]
    return found


def texts(found):
    return [[cell.text for cell in one] for one in found.rows]


def test_a_run_is_read_as_means_of_its_evaluations(tmp_path):
    [run] = recorded(tmp_path, seeds=1)
    found = read_run(run)
    assert found.steps.tolist() == [0, 1000, 2000, 3000]
    assert found.means["S+T"].tolist() == [0, 1, 1, 1]
    assert found.newest["S+T+C"] == pytest.approx(0.8)
    # The horizon is 500 steps, the episodes have 250.
    assert found.newest[PADDED] == pytest.approx(0.4)
    assert found.newest["encourage.slow"] == pytest.approx(0.7)
    assert found.episodes == EPISODES
    assert found.is_complete
    assert np.isnan(found.seconds).all()


def test_the_offline_table_counts_seeds_and_sets_the_best_in_bold(tmp_path):
    recorded(tmp_path, seeds=4)
    recorded(tmp_path, "sparse", seeds=4, good=lambda seed: seed == 0)
    found = table(tmp_path, "offline")
    assert texts(found) == [
        ["hprs paper", "4", "1.00", "1.00", "0", "1.00", "1.00 to 1.00", "0.80"],
        ["sparse", "4", "0.25", "0.25", "3", "0.00", "0.00 to 0.75", "0.20"],
        ["doing nothing", "", "0.00", "0.00", "", "", "", "0.00"],
    ]
    assert [cells[-1].bold for cells in found.rows] == [True, False, False]


def test_one_seed_gets_wilsons_interval_over_its_episodes(tmp_path):
    recorded(tmp_path, seeds=1)
    # Of 10 successes in 10: 1 / (1 + z^2 / 10) with z = 1.95996.
    assert texts(table(tmp_path, "offline"))[0][6] == "0.72 to 1.00"


def test_the_probability_of_improvement_counts_ties_half(tmp_path):
    recorded(tmp_path, seeds=4)
    recorded(tmp_path, "sparse", seeds=4, good=lambda seed: seed < 2)
    found = texts(table(tmp_path, "improvement"))
    # Half of the pairs tie, half are won.
    assert found[0][2].startswith("0.75 (")
    assert found[1][1].startswith("0.25 (")
    assert found[0][3] == "1.00"


def test_the_ablation_sets_comfort_beside_no_comfort(tmp_path):
    recorded(tmp_path)
    recorded(tmp_path, "hprs-no-comfort", good=lambda seed: False)
    found = table(tmp_path, "ablation")
    assert found.header == ("requirement", "hprs paper", "hprs-no-comfort paper", "doing nothing")
    assert texts(found)[1] == ["slow", "0.70 ± 0.00", "0.25 ± 0.00", "0.25"]


def test_what_never_gets_there_counts_as_infinite(tmp_path):
    recorded(tmp_path, seeds=3, good=lambda seed: seed > 0)
    recorded(tmp_path, "sparse", seeds=3, good=lambda seed: seed == 0)
    first, second = texts(table(tmp_path, "cost"))
    assert first[1:4] == ["1,000", "not known", "1"]
    assert second[1:4] == ["never", "never", "2"]


def test_the_bold_rule_gives_the_papers_bold_numbers():
    from hprs.experiments.tables import CLOSE

    bold = {}
    for name in ("SafeDriving", "FollowLeader", "LunarLanderObstacle", "BipedalWalker"):
        rows = published.offline(f"hprs/{name}-v0")
        best = max(one.padded_comfort for one in rows.values())
        bold[name] = {key for key, one in rows.items() if one.padded_comfort >= best - CLOSE}
    assert bold == {
        "SafeDriving": {"morl-uniform", "morl-decreasing", "hprs"},
        "FollowLeader": {"hprs"},
        "LunarLanderObstacle": {"morl-uniform", "morl-decreasing", "hprs"},
        "BipedalWalker": {"env", "hprs"},
    }


def test_the_published_wishes_are_requirements_of_our_tasks():
    from hprs.envs.registration import benchmark_of

    for name in ("SafeDriving", "FollowLeader", "LunarLanderObstacle", "BipedalWalker"):
        environment = f"hprs/{name}-v0"
        labels = {
            r.label for r in configure(environment).task.requirements if r.kind == "encourage"
        }
        assert benchmark_of(environment) is not None
        assert set(published.ablation(environment)) == labels


def test_settings_that_differ_are_in_the_labels(tmp_path):
    recorded(tmp_path, settings={"gamma": 0.9})
    recorded(tmp_path, settings={"gamma": 0.95})
    recorded(tmp_path, "env")
    found = {group.label for group in section(tmp_path).benchmark.groups}
    assert found == {"hprs paper gamma=0.9", "hprs paper gamma=0.95", "env"}


def test_what_was_read_is_kept_and_read_again_when_it_changes(tmp_path):
    first, second = recorded(tmp_path / "runs")
    shelf = Shelf(tmp_path / "kept.npz")
    before = shelf.read(first), shelf.read(second)
    shelf.save()
    again = Shelf(tmp_path / "kept.npz")
    with (first.path / EVALUATIONS_FILE).open("a") as stream:
        stream.writelines(row(4000, episode, good=True) for episode in range(EPISODES))
    (second.path / "unread").touch()
    found = again.read(first), again.read(second)
    assert found[0].steps.tolist() == [0, 1000, 2000, 3000, 4000]
    assert found[1].configuration == before[1].configuration
    for name, values in before[1].means.items():
        assert (found[1].means[name] == values).all()


def test_a_damaged_cache_is_made_anew(tmp_path):
    [run] = recorded(tmp_path / "runs", seeds=1)
    (tmp_path / "kept.npz").write_bytes(b"PK\x03\x04 half a file")
    assert Shelf(tmp_path / "kept.npz").read(run).is_complete


def test_columns_are_the_rows_and_a_wrong_line_is_named(tmp_path):
    [run] = recorded(tmp_path, seeds=1)
    rows, columns = run.evaluations(), run.evaluation_columns()
    assert {name: values.tolist() for name, values in columns.items()} == {
        name: [one[name] for one in rows] for name in rows[0]
    }
    file = run.path / EVALUATIONS_FILE
    files.replace(file, file.read_bytes().replace(b"\n1000,3,", b"\n1000,x,", 1))
    with pytest.raises(Exception, match="line 15 is no row"):
        evaluation_table.read_columns(file)


def test_mixed_versions_and_unfinished_runs_are_said(tmp_path):
    first, _ = recorded(tmp_path, steps=5000)
    content = json.loads((first.path / RUN_FILE).read_text())
    content["versions"]["numpy"] = "1.0"
    (first.path / RUN_FILE).write_text(json.dumps(content))
    found, _ = read_all(find_below(tmp_path), Shelf(tmp_path / "none.npz"))
    unfinished, mixed = warnings_of(found)
    assert unfinished.startswith("2 of 2 runs are not trained to their end")
    assert re.match(r"Mixed versions of numpy: 1 with 1\.0, 1 with ", mixed)


def test_the_best_run_is_the_most_comfortable_seed(tmp_path):
    recorded(tmp_path, seeds=3, good=lambda seed: seed == 1)
    assert best_run(section(tmp_path)).configuration.seed == 1


def test_a_report_is_tables_pictures_and_a_page(tmp_path):
    recorded(tmp_path / "runs")
    recorded(tmp_path / "runs", "sparse", good=lambda seed: False)
    page = write_report([section(tmp_path / "runs")], tmp_path / "report", title="A <b>title</b>")
    names = {path.name for path in page.parent.iterdir()}
    assert names == {
        "report.html", "cartpole-v0-steps.png", "cartpole-v0-steps.svg",
        *(f"cartpole-v0-{name}.{end}" for end in ("csv", "tex")
          for name in ("offline", "requirements", "improvement", "cost")),
    }  # fmt: skip
    with (page.parent / "cartpole-v0-offline.csv").open(newline="") as stream:
        rows = list(csv.reader(stream))
    assert rows[1][:4] == ["hprs paper", "2", "1", "1"]
    latex = (page.parent / "cartpole-v0-offline.tex").read_text()
    assert r"\textbf{0.80}" in latex
    assert r"95 \% of S+T" in latex
    text = page.read_text()
    assert "<title>A &lt;b&gt;title&lt;/b&gt;</title>" in text
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)", text)


def test_equal_runs_give_equal_files(tmp_path):
    recorded(tmp_path / "runs")
    made = []
    for name in ("one", "other"):
        folder = write_report([section(tmp_path / "runs")], tmp_path / name, title="t").parent
        made.append({path.name: path.read_bytes() for path in sorted(folder.iterdir())})
    assert made[0] == made[1]


@pytest.fixture
def command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        code = main(["report", *map(str, arguments)])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run


def test_the_command_writes_the_page_with_measured_floors(command, tmp_path):
    recorded(tmp_path / "runs")
    (tmp_path / "runs" / "empty").mkdir()
    [none] = create_runs([configure("hprs/CartPole-v0", reward="env")], tmp_path / "runs")
    code, out, err = command("runs", "--no-pictures")
    assert (code, err) == (0, "")
    assert re.search(r"^hprs paper +2 +1\.00 +1\.00 +0 ", out, re.MULTILINE)
    assert re.search(r"^random +0\.00 +0\.00 +0\.00$", out, re.MULTILINE)
    assert f"Left out: {none.path.relative_to(tmp_path)} holds no evaluation yet." in out
    assert out.endswith("Written: report/report.html\n")


def test_mistakes_are_explained(command, tmp_path):
    (tmp_path / "empty").mkdir()
    create_runs([configure("hprs/CartPole-v0")], tmp_path / "new")
    for arguments, code, message in (
        (
            ("gone",),
            2,
            "'gone' does not exist: give the folder that hprs benchmark or train wrote.",
        ),
        (("empty",), 2, "'empty' holds no run"),
        (("new", "--no-pictures"), 2, "'new' holds no run with results."),
        (
            ("new", "--compare", "papr"),
            2,
            "--compare takes paper, not 'papr'. Did you mean 'paper'?",
        ),
        (("new", "--episodes", "0"), 2, "--episodes must be at least 1, got 0."),
    ):
        found, out, err = command(*arguments)
        assert (found, out) == (code, ""), arguments
        assert err.startswith(f"hprs: {message}"), err
