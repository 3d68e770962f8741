"""What the pages in docs/environments say about tasks, derived from the tasks.

`python tests/envs/pages.py` writes it between the marks of each page; a test compares the two.
"""

from __future__ import annotations

from pathlib import Path

from hprs.envs import BENCHMARKS
from hprs.spec.printer import format_predicate

FOLDER = Path(__file__).parents[2] / "docs" / "environments"
PAGES = {
    "cart_pole": "hprs/CartPole-v0",
    "lunar_lander": "hprs/LunarLanderObstacle-v0",
    "bipedal_walker": "hprs/BipedalWalker-v0",
    "safe_driving": "hprs/SafeDriving-v0",
    "follow_leader": "hprs/FollowLeader-v0",
}
"""Page to the benchmark whose task it shows."""
FIRST = "<!-- derived from the task by `python tests/envs/pages.py` -->\n"
LAST = "<!-- end -->\n"


def derived(benchmark_id: str) -> str:
    """The task's text, its signals and its requirements."""
    benchmark = BENCHMARKS[benchmark_id]
    task = benchmark.task
    # Bounds hold for margins, whose unit is that of the predicate.
    requirements = [
        (
            requirement.label,
            requirement.kind,
            f"`{format_predicate(requirement.predicate)}`",
            "{:.4g} to {:.4g}".format(*task.bounds[requirement.label]),
        )
        for requirement in task.requirements
    ]
    signals = [
        (
            f"`{signal.name}`",
            f"`{signal.source}`" if signal.source else f'`info["signals"]["{signal.name}"]`',
            f"{task.ranges[signal.name].low:.4g} to {task.ranges[signal.name].high:.4g}",
            signal.unit or "-",
        )
        for signal in task.signals
    ]
    return "\n".join(
        (
            f"```hprs\n{benchmark.task_text}```\n",
            table(("signal", "reads", "range", "unit"), signals),
            table(("requirement", "kind", "holds where", "margin"), requirements),
        )
    )


def table(header: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = [header, ("---",) * len(header), *rows]
    return (
        "".join(f"| {' | '.join(line)} |\n" for line in lines)
        .replace("| --- |", "|---|")
        .replace(" --- |", "---|")
    )


def rendered(page: str, text: str) -> str:
    """A page's text with what is derived put between its marks."""
    before, _, rest = text.partition(FIRST)
    _, _, after = rest.partition(LAST)
    return f"{before}{FIRST}\n{derived(PAGES[page])}\n{LAST}{after}"


if __name__ == "__main__":
    for name in PAGES:
        path = FOLDER / f"{name}.md"
        path.write_text(rendered(name, path.read_text("utf-8")), encoding="utf-8")
