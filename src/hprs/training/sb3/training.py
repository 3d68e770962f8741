"""Trains a run to its end, from wherever it was left."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hprs.errors import RunError
from hprs.training.checkpoint import Checkpoint
from hprs.training.environment import require
from hprs.training.interruption import Interruption
from hprs.training.listener import Listener, Silence
from hprs.training.random_states import derive_seed
from hprs.training.replay import load_segments
from hprs.training.run_directory import RunDirectory
from hprs.training.sb3.events import make_logger
from hprs.training.sb3.model import make_model, make_vector, refuse_divergence
from hprs.training.sb3.policy import save_policies, threads
from hprs.training.sb3.state import Restoration, replay_ring

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.vec_env import VecEnv

    from hprs.training.sb3.recorder import Recorder


def train(run: RunDirectory, listener: Listener | None = None) -> bool:
    """Train to the end of the configuration, from the newest checkpoint if there is one.

    The first SIGINT (Ctrl-C) or SIGTERM stops where the state is whole, and saves it.

    Args:
        run: The run directory.
        listener: Hears of the progress.

    Returns:
        Whether the training is complete; false if it was interrupted.

    Raises:
        RunError: The run cannot be read, written or gone on with, another process trains it, or the
            training diverged.
    """
    require("stable_baselines3", "sb3")
    require("tensorboard", "sb3")
    require("torch", "sb3")
    listener = listener or Silence()
    configuration = run.configuration
    with run.locked(), threads(configuration.parameters["threads"]):
        checkpoint = run.open(listener.noticed)
        if checkpoint is not None:
            save_policies(run, checkpoint)
            if checkpoint.progress.step >= configuration.steps:
                listener.noticed(f"{run.path} is complete: {checkpoint.progress.step:,} steps.")
                return True
            if run.changed_versions:
                listener.noticed(
                    f"{run.path} was begun with {', '.join(run.changed_versions)}. "
                    "The numbers may not be those of an uninterrupted training."
                )
        with Interruption(listener.stopping) as interruption:
            return _train(run, checkpoint, listener, interruption)


def _train(
    run: RunDirectory, checkpoint: Checkpoint | None, listener: Listener, interruption: Interruption
) -> bool:
    from hprs.training.sb3.recorder import Recorder, Stopped

    steps, first = run.configuration.steps, 0 if checkpoint is None else checkpoint.progress.step
    environments = make_vector(run.configuration)
    logger = None
    try:
        model, restoration = open_model(run, checkpoint, environments, listener)
        logger = make_logger(run, first)
        model.set_logger(logger)
        listener.started(run.configuration, first)
        recorder = Recorder(run, checkpoint, restoration, listener, interruption)
        _learn(model, steps - first, recorder)
    except Stopped:
        return False
    finally:
        listener.ended()
        environments.close()
        if logger is not None:
            logger.close()
    return True


def _learn(model: BaseAlgorithm, steps: int, recorder: Recorder) -> None:
    try:
        model.learn(steps, recorder, reset_num_timesteps=False)
    except ValueError:
        # Some distributions refuse NaN, before the recorder does.
        refuse_divergence(model)
        raise


def open_model(
    run: RunDirectory, checkpoint: Checkpoint | None, environments: VecEnv, listener: Listener
) -> tuple[BaseAlgorithm, Restoration | None]:
    """The model as a checkpoint left it, but for the random states: these must come last."""
    configuration = run.configuration
    if checkpoint is None:
        model = make_model(configuration, environments)
        environments.seed(derive_seed(configuration.seed, 0))
        return model, None
    restoration = Restoration(checkpoint.contents)
    model = restoration.model(configuration, environments)
    if (ring := replay_ring(model)) is not None:
        try:
            load_segments(run.replay, ring, checkpoint.segments)
        except RunError as error:
            raise run.cannot_go_on(error) from None
    restarted = restoration.environments(model, configuration.seed)
    if restarted:
        reasons = "; ".join(sorted(set(restarted)))
        listener.noticed(
            f"{len(restarted)} of {environments.num_envs} environments begin a new episode: "
            f"{reasons}. The numbers will not be those of an uninterrupted training."
        )
    return model, restoration
