"""`hprs watch`: a video of an episode, with the state of every requirement drawn on it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from hprs.cli.inputs import Constants, task_by_name
from hprs.errors import UsageError

if TYPE_CHECKING:
    from hprs.explanation.explanation import Explanation
    from hprs.explanation.film import Film
    from hprs.training.evaluation import Episode
    from hprs.training.policies import Policy
    from hprs.wrappers.single import TaskWrapper


@dataclass(frozen=True)
class Watch:
    """Film an episode: the scene, and beside it each requirement with its margin.

    A tick says that a requirement holds, a cross that it does not; its bar is the margin, from its
    lower bound on the left to its upper bound on the right, and a dot stays where it was violated
    before. Of a recorded log, which has no scene, the requirements are filmed alone.

    Examples:
      hprs watch runs/hprs-SafeDriving-v0/hprs-ppo-1a2b3c4d/seed-0
      hprs watch runs/hprs-SafeDriving-v0/hprs-ppo-1a2b3c4d/seed-0 --worst --out worst.mp4
      hprs watch runs/hprs-SafeDriving-v0/hprs-ppo-1a2b3c4d/seed-0 --violation --episodes 500
      hprs watch hprs/LunarLanderObstacle-v0 --policy random --seed 7
      hprs watch log.csv --task my_task.hprs --rate 10
    """

    subject: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="RUN|ENV|LOG")]
    """Run directory; with --policy, an environment; or a log as `hprs assess` reads it."""
    out: Annotated[Path, tyro.conf.arg(metavar="FILE")] = Path("episode.gif")
    """The video: a .gif or .webp, or, with the program ffmpeg, an .mp4, .webm, .mkv or .mov."""
    best: bool = False
    """Film the episode with the highest PAM of several."""
    worst: bool = False
    """Film the episode with the lowest PAM of several."""
    violation: bool = False
    """Film the first episode of several in which a safety requirement is violated."""
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 50
    """How many episodes --best, --worst and --violation pick from: those of `hprs evaluate`."""
    seed: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Seed of the episode; default: the first one that `hprs evaluate` takes."""
    policy: Annotated[str | None, tyro.conf.arg(metavar="POLICY", help_behavior_hint="")] = None
    """zero, random, a bundle, a .zip of Stable-Baselines3, an ONNX file, or module:function."""
    which: str = "last"
    """The policy of a run: last, or best (by PAM)."""
    task: Annotated[str | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """Task file, or the id of a benchmark; default: the run's or the environment's own task."""
    constants: Constants = ()
    options: Annotated[
        tyro.conf.UseAppendAction[tuple[str, ...]],
        tyro.conf.arg(name="env", metavar="KEY=VALUE"),
    ] = ()
    """An option of the environment, as its constructor names it; default: as trained."""
    horizon: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """End the episode after this many steps; default: as trained, or as registered."""
    rate: Annotated[float | None, tyro.conf.arg(metavar="HZ", help_behavior_hint="")] = None
    """Steps a second; default: as the environment states it, 10 for a log."""

    def run(self) -> int:
        """Film the episode."""
        from hprs.explanation.video import check_suffix
        from hprs.explanation.wording import summary
        from hprs.training.environment import require

        require("PIL", "report")
        check_suffix(self.out)
        if not self.out.absolute().parent.is_dir():
            raise UsageError(f"there is no folder '{self.out.parent}' for --out {self.out}.")
        if self.rate is not None and not 0.0 < self.rate < float("inf"):
            raise UsageError(f"--rate must be positive, got {self.rate:g}.")
        found, film = self._log() if self._is_log else self._episode()
        _write(found, film, self.out)
        print(f"{found.title}: {summary(found)}")
        if film.trouble:
            print(f"No pictures: {film.trouble}")
        print(f"Written: {self.out}")
        return 0

    @property
    def _is_log(self) -> bool:
        from hprs.cli.trace_file import is_bag

        path = Path(self.subject)
        return self.policy is None and (path.is_file() or is_bag(path))

    def _log(self) -> tuple[Explanation, Film]:
        from hprs.cli.trace_columns import Wanted
        from hprs.cli.trace_file import open_trace
        from hprs.explanation.explanation import explain, joined
        from hprs.explanation.film import Film

        if self._picks or self.seed is not None:
            raise UsageError(
                "--best, --worst, --violation and --seed are for a policy; "
                f"'{self.subject}' is a log."
            )
        if self.task is None:
            raise UsageError(
                f"'{self.subject}' is a log: name its task too, as in --task my_task.hprs."
            )
        task = task_by_name(self.task, self.constants)
        recording = open_trace(Path(self.subject), Wanted(task, unused=False))
        found = explain(
            task,
            joined(recording.chunks),
            title=self.subject,
            rate=self.rate,
            notes=recording.notes,
        )
        return found, Film(trouble="a log has none.")

    def _episode(self) -> tuple[Explanation, Film]:
        import os

        from hprs.explanation.episode import record
        from hprs.explanation.explanation import explain
        from hprs.explanation.film import VIDEO

        for option, value, least in (
            ("episodes", self.episodes, 1),
            ("horizon", self.horizon, 1),
            ("seed", self.seed, 0),
        ):
            if value is not None and value < least:
                raise UsageError(f"--{option} must be at least {least}, got {value}.")
        # Pygame draws into memory; no window is needed.
        os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
        title, make, policy = self._acting()
        seed = self._seed(make, policy)
        played = record(make, policy, seed, VIDEO)
        environment = make()
        task = environment.task
        environment.close()
        rate = self.rate or played.rate
        named = f"{title}, episode {seed}"
        return explain(task, played.trace, title=named, rate=rate), played.film

    def _acting(self) -> tuple[str, Callable[..., TaskWrapper], Policy]:
        from hprs.cli.assessed_run import (
            check_which,
            environment_of,
            named_environment,
            policies_of_runs,
            policy_by_name,
        )
        from hprs.training.run_directory import find_runs

        which = check_which(self.which)
        asked: dict[str, Any] = {
            "task_path": self.task,
            "constants": self.constants,
            "options": self.options,
            "horizon": self.horizon,
        }
        if self.policy is not None:
            make = named_environment(self.subject, **asked)
            title = f"{self.subject}, policy {self.policy}"
            return title, make, policy_by_name(self.policy, make)
        run, *others = find_runs(Path(self.subject))
        if others:
            raise UsageError(
                f"'{self.subject}' holds {len(others) + 1} seeds; name one, as in {run.path}"
            )
        make = environment_of(run, **asked)
        (policy,) = policies_of_runs([run], which, make).values()
        configuration = run.configuration
        title = (
            f"{configuration.environment}, {configuration.reward} reward, "
            f"{configuration.algorithm}, seed {configuration.seed}, {which} policy"
        )
        return title, make, policy

    @property
    def _picks(self) -> list[str]:
        chosen = {"best": self.best, "worst": self.worst, "violation": self.violation}
        return [name for name, wanted in chosen.items() if wanted]

    def _seed(self, make: Callable[..., TaskWrapper], policy: Policy) -> int:
        from hprs.training.evaluation import FINAL_SEEDS

        picks = self._picks
        if len(picks) + (self.seed is not None) > 1:
            given = [f"--{name}" for name in [*picks, *(["seed"] if self.seed is not None else [])]]
            raise UsageError(f"{' and '.join(given)} exclude each other; name one of them.")
        if not picks:
            return FINAL_SEEDS if self.seed is None else self.seed
        return _pick(picks[0], self._played(make, policy))

    def _played(self, make: Callable[..., TaskWrapper], policy: Policy) -> list[Episode]:
        from hprs.cli.console import console
        from hprs.cli.progress import EvaluationProgress
        from hprs.training.evaluation import FINAL_SEEDS, episode_seeds, evaluate

        seeds = episode_seeds(FINAL_SEEDS, self.episodes)
        screen = console(stderr=True)
        with EvaluationProgress(screen, policies=1, episodes=self.episodes) as progress:
            return evaluate(make, policy, seeds, progress.watcher("choosing an episode"))


def _write(found: Explanation, film: Film, path: Path) -> None:
    """Write the video, and show how far it is."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    from hprs.cli.console import console
    from hprs.explanation.video import write_video

    screen = console(stderr=True)
    columns = (TextColumn("drawing"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=screen, disable=not screen.is_terminal, transient=True) as bar:
        task = bar.add_task("")
        write_video(
            found, film, path, lambda done, total: bar.update(task, completed=done, total=total)
        )


def _pick(which: str, episodes: Sequence[Episode]) -> int:
    """The seed of the episode that is asked for.

    Raises:
        PolicyError: No episode violates a safety requirement.
    """
    from hprs.errors import PolicyError

    if which == "best":
        return max(episodes, key=lambda episode: float(episode.assessment.pam)).seed
    if which == "worst":
        return min(episodes, key=lambda episode: float(episode.assessment.pam)).seed
    unsafe = [episode.seed for episode in episodes if not episode.assessment.safe]
    if not unsafe:
        raise PolicyError(
            f"no safety requirement is violated in {len(episodes)} episodes; "
            "look at more of them with --episodes N."
        )
    return unsafe[0]
