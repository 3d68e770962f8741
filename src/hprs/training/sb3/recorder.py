"""Evaluates, records and saves a running training."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace

from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback

from hprs.semantics.assessment import summarise
from hprs.training.checkpoint import Checkpoint, Progress
from hprs.training.environment import make_configured
from hprs.training.evaluation import Episode, evaluate, training_seeds
from hprs.training.evaluation_table import format_rows
from hprs.training.events import assessment_scalars
from hprs.training.interruption import Interruption, Stopped
from hprs.training.listener import Listener
from hprs.training.run_directory import RunDirectory
from hprs.training.sb3.model import refuse_divergence
from hprs.training.sb3.policy import Learner, save_policies
from hprs.training.sb3.state import Restoration, capture, replay_ring


class Recorder(BaseCallback):
    """Acts between rollouts: only there the model's state is whole.

    Args:
        run: The run directory.
        checkpoint: Where the training goes on from.
        restoration: Of that checkpoint; its random states are brought back at the first rollout.
        listener: Hears of the progress.
        interruption: Asks the training to stop.
    """

    def __init__(
        self,
        run: RunDirectory,
        checkpoint: Checkpoint | None,
        restoration: Restoration | None,
        listener: Listener,
        interruption: Interruption,
    ) -> None:
        super().__init__()
        self._run, self._listener, self._interruption = run, listener, interruption
        self._restoration = restoration
        saved = checkpoint or Checkpoint(Progress(), rows="", contents={})
        self._progress, self._rows, self._segments = saved.progress, saved.rows, saved.segments

    def _on_step(self) -> bool:
        self._listener.advanced(self.num_timesteps)
        return True

    def _on_rollout_start(self) -> None:
        if self._restoration is not None:
            self._restoration.random(self.model)
            self._restoration = None
        if self.model.num_timesteps >= self._progress.next_evaluation:
            # An abandoned evaluation comes again: the progress still says that it is due.
            with suppress(Stopped):
                self._record(watch=self._look_up)
        if self._interruption.requested:
            if self.model.num_timesteps > self._progress.step:
                self._progress = replace(self._progress, step=self.model.num_timesteps)
                self._save(evaluated=False)
            raise Stopped

    def _on_training_end(self) -> None:
        if self.model.num_timesteps > self._progress.step:
            self._record()

    def _look_up(self, complete: int) -> None:
        if self._interruption.requested:
            raise Stopped

    def _record(self, watch: Callable[[int], None] | None = None) -> None:
        refuse_divergence(self.model)
        step, configuration = self.model.num_timesteps, self._run.configuration
        seeds = training_seeds(self._progress.evaluations, configuration.evaluation_episodes)
        policy = Learner(self.model)
        episodes = evaluate(lambda: make_configured(configuration), policy, seeds, watch)
        self._progress = self._progress.after(step, episodes, configuration.interval_after)
        self._rows = format_rows(configuration.task, step, episodes)
        save_policies(self._run, self._save(evaluated=True))
        _log(self.model, step, episodes)
        self._listener.evaluated(step, summarise([episode.assessment for episode in episodes]))

    def _save(self, *, evaluated: bool) -> Checkpoint:
        refuse_divergence(self.model)
        saved = Checkpoint(self._progress, self._rows, capture(self.model), self._segments)
        saved = self._run.save(saved, evaluated=evaluated, ring=replay_ring(self.model))
        self._segments = saved.segments
        return saved


def _log(model: BaseAlgorithm, step: int, episodes: Sequence[Episode]) -> None:
    summary = summarise([episode.assessment for episode in episodes])
    for name, value in assessment_scalars(summary).items():
        model.logger.record(name, value)
    model.logger.dump(step)
