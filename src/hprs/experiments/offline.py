"""Assesses policies over fresh episodes, and keeps what was found, since it takes long."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from hprs.experiments.groups import Benchmark
from hprs.experiments.recorded import PADDED, padded
from hprs.semantics.assessment import Assessment
from hprs.spec.json_format import task_to_json
from hprs.training import files
from hprs.training.configuration import Configuration
from hprs.training.environment import make_configured
from hprs.training.evaluation import FINAL_SEEDS, episode_seeds, evaluate
from hprs.training.measures import SUMMARY, values_by_measure
from hprs.training.policies import Policy, floors
from hprs.training.run_directory import RunDirectory
from hprs.training.trained import load_policy

Means: TypeAlias = Mapping[str, float]
"""Measure to its mean over episodes: S, S+T, S+T+C, PAM, and `kind.label` of each requirement."""

Watch: TypeAlias = Callable[[str], Callable[[int], None]]
"""Given what is assessed, what is to be told how many episodes are complete."""


class Assessments:
    """Assesses what is asked for, unless it has before.

    Args:
        file: Where results are kept; each one is written as soon as it is there.
        episodes: Of a policy.
        watch: Told of the progress.
    """

    def __init__(self, file: Path, episodes: int, watch: Watch) -> None:
        self._file, self._episodes, self._watch = file, episodes, watch
        self._kept: dict[str, Means] = {}
        # What is damaged is made anew.
        with suppress(OSError, ValueError):
            self._kept = dict(json.loads(file.read_text(encoding="utf-8")))

    def of_run(self, run: RunDirectory) -> Means:
        """Those of a run's last policy.

        Raises:
            RunError: It has none.
        """
        policy = run.policy_file("last")
        key = _key("run", files.checksum(files.read(policy)), _place(run.configuration))
        return self._measured(
            key, str(run.path), run.configuration, lambda _: load_policy(run, "last")
        )

    def floors(self, benchmark: Benchmark) -> dict[str, Means]:
        """Those of doing nothing and of random actions."""
        configuration = benchmark.configuration
        environment = make_configured(configuration)
        names = list(floors(environment.action_space))
        environment.close()
        return {
            name: self._measured(
                _key(name, _place(configuration)),
                f"{benchmark.name}, {name}",
                configuration,
                lambda space, name=name: floors(space)[name],
            )
            for name in names
        }

    def _measured(
        self,
        key: str,
        title: str,
        configuration: Configuration,
        policy: Callable[[Any], Policy],
    ) -> Means:
        key = f"{key}-{self._episodes}"
        if key not in self._kept:
            environment = make_configured(configuration)
            space = environment.action_space
            environment.close()
            found = evaluate(
                lambda: make_configured(configuration),
                policy(space),
                episode_seeds(FINAL_SEEDS, self._episodes),
                self._watch(title),
            )
            self._kept[key] = _means(configuration, [episode.assessment for episode in found])
            with files.writing(self._file):
                files.replace(self._file, json.dumps(self._kept).encode())
        return self._kept[key]


def _means(configuration: Configuration, assessments: Iterable[Assessment]) -> Means:
    found = list(assessments)
    values = values_by_measure(configuration.task, found)
    lengths = np.array([float(one.length) for one in found])
    values[PADDED] = padded(configuration, np.array(values["PAM"]), lengths).tolist()
    # A table of evaluations names a requirement `kind.label`.
    return {
        name if name in (*SUMMARY, PADDED) else name.replace(" ", ".", 1): float(np.mean(column))
        for name, column in values.items()
    }


def _place(configuration: Configuration) -> Any:
    return [
        configuration.environment,
        dict(configuration.environment_options),
        configuration.horizon,
        task_to_json(configuration.task),
    ]


def _key(*parts: Any) -> str:
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]
