"""Trains with Stable-Baselines3, and loads what it has trained."""

from __future__ import annotations

import inspect
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np

from hprs.errors import RunError, UsageError, did_you_mean
from hprs.rewards.hierarchical import ENDS, End
from hprs.semantics.assessment import summarise
from hprs.training import algorithms
from hprs.training.checkpoint import Progress
from hprs.training.configuration import Configuration
from hprs.training.environment import find_task, make_configured, make_environment, require
from hprs.training.evaluation import TRAINING_SEEDS, Episode, episode_seeds, evaluate
from hprs.training.interruption import Interruption
from hprs.training.listener import Listener, Silence
from hprs.training.run_directory import RunDirectory, Which

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.vec_env import VecEnv

MODEL, POLICY, REWARD_SCALE, REPLAY = "model.zip", "policy.zip", "reward_scale.pkl", "replay.pkl"

_NOT_HYPERPARAMETERS = frozenset(
    {
        "self",
        "policy",
        "env",
        "action_noise",
        "replay_buffer_class",
        "rollout_buffer_class",
        "tensorboard_log",
        "verbose",
        "seed",
        "device",
        "_init_setup_model",
    }
)


def configure(
    environment: str,
    *,
    task_path: str | None = None,
    reward: str = "hprs",
    end: End = "paper",
    algorithm: str | None = None,
    settings: Mapping[str, Any] | None = None,
    steps: int | None = None,
    horizon: int | None = None,
    evaluation_interval: int = 10_000,
    evaluation_episodes: int = 10,
    seed: int = 0,
) -> Configuration:
    """A checked configuration of a training.

    Args:
        environment: Gymnasium id, or `module:id`.
        task_path: A task file; None: the benchmark's own task.
        reward: A name of `REWARDS`.
        end: End-of-episode convention.
        algorithm: A name of `ALGORITHMS`; None: SAC for continuous actions, else PPO.
        settings: Hyper-parameters to override.
        steps: Environment steps; None: what the benchmark needs.
        horizon: Truncate episodes after this many steps; None: as registered.
        evaluation_interval: Steps between two evaluations.
        evaluation_episodes: Episodes of an evaluation.
        seed: Seed of the training.

    Raises:
        UsageError: A name, a hyper-parameter or a number is wrong.
        SpecError: The task is wrong.
        SignalError: The environment lacks a signal of the task.
    """
    stable_baselines3 = require("stable_baselines3", "sb3")
    steps = algorithms.STEPS.get(environment, algorithms.DEFAULT_STEPS) if steps is None else steps
    counts = {
        "steps": steps,
        "horizon": horizon,
        "evaluation interval": evaluation_interval,
        "evaluation episodes": evaluation_episodes,
    }
    for name, value in counts.items():
        if value is not None and value < 1:
            raise UsageError(f"the {name} must be at least 1, got {value}.")
    if end not in ENDS:
        raise UsageError(
            f"unknown end '{end}'; choose one of {', '.join(ENDS)}.{did_you_mean(end, ENDS)}"
        )
    task, text = find_task(environment, task_path)
    # Any discount will do to see that the reward exists and the environment has every signal.
    made = make_environment(environment, task, reward, end=end, discount=0.5, horizon=horizon)
    chosen = algorithms.find_algorithm(algorithm, type(made.action_space).__name__)
    made.close()
    own = hyperparameters(getattr(stable_baselines3, chosen.class_name))
    return Configuration(
        environment=environment,
        task_text=text,
        algorithm=chosen.name,
        parameters=algorithms.resolve_parameters(chosen, environment, settings or {}, own),
        steps=steps,
        reward=reward,
        end=end,
        horizon=horizon,
        evaluation_interval=evaluation_interval,
        evaluation_episodes=evaluation_episodes,
        seed=seed,
    )


def hyperparameters(kind: type[BaseAlgorithm]) -> dict[str, tuple[Any, Any]]:
    """An algorithm's own arguments that a user may set: name to annotation and default."""
    return {
        name: (parameter.annotation, parameter.default)
        for name, parameter in inspect.signature(kind.__init__).parameters.items()
        if name not in _NOT_HYPERPARAMETERS
    }


def train(run: RunDirectory, listener: Listener | None = None) -> bool:
    """Train to the end of the configuration, from the newest checkpoint if there is one.

    The first Ctrl-C stops where the state is whole, and saves it.

    Args:
        run: The run directory.
        listener: Hears of the progress.

    Returns:
        Whether the training is complete; false if it was interrupted.
    """
    require("stable_baselines3", "sb3")
    require("tensorboard", "sb3")
    require("torch", "sb3")
    with _threads(run.configuration.parameters["threads"]):
        return _train(run, listener or Silence())


@dataclass(frozen=True)
class Learner:
    """A policy trained by Stable-Baselines3, acting deterministically."""

    model: Any

    def __call__(self, observation: Any, /) -> Any:
        """The action to take."""
        return self.batch([observation])[0]

    def batch(self, observations: Sequence[Any]) -> Sequence[Any]:
        """One action for each observation."""
        with _threads(1):
            return list(self.model.predict(_stack(observations), deterministic=True)[0])


def load_policy(run: RunDirectory, which: Which) -> Learner:
    """A policy that a run keeps.

    Raises:
        RunError: There is none.
    """
    return load_zip(run.policy(which) / POLICY)


def load_zip(path: Path) -> Learner:
    """A policy in a file that Stable-Baselines3 wrote. Such a file can execute code.

    Raises:
        UsageError: The file does not exist or is not such a file.
    """
    stable_baselines3 = require("stable_baselines3", "sb3")
    from stable_baselines3.common.save_util import load_from_zip_file

    if not path.is_file():
        raise UsageError(f"there is no policy file '{path}'.")
    try:
        data, _, _ = load_from_zip_file(path, device="cpu")
    except (ValueError, KeyError) as error:
        raise UsageError(f"'{path}' is not a Stable-Baselines3 policy: {error}") from None
    if data is None or "policy_class" not in data:
        raise UsageError(f"'{path}' is not a Stable-Baselines3 policy.")
    kind = getattr(stable_baselines3, _class_name(data))
    return Learner(kind.load(path, device="cpu"))


def _class_name(data: Mapping[str, Any]) -> str:
    """Which algorithm wrote a file; the file itself only says which networks it holds."""
    family = data["policy_class"].__module__.split(".")[1]
    if family in ("sac", "td3", "dqn"):
        return family.upper()
    return "PPO" if "clip_range" in data else "A2C"


@contextmanager
def _threads(count: int) -> Iterator[None]:
    """Let PyTorch use this many threads, and set it back.

    On a busy machine a second thread makes a small network fifty times slower: each waits for the
    other at every layer.
    """
    import torch

    before = torch.get_num_threads()
    if before == count:
        yield
        return
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _train(run: RunDirectory, listener: Listener) -> bool:
    configuration = run.configuration
    folder = run.checkpoint()
    progress = Progress() if folder is None else Progress.load(folder)
    run.truncate(progress.step if folder else -1)
    environments = _make_vector(configuration, folder)
    try:
        model = _make_model(configuration, environments, folder)
        environments.seed(_derive_seed(configuration.seed, progress.step))
        if folder is not None and progress.best_step == progress.step:
            _save_policy(run, "best", model, progress)
        model.set_logger(_make_logger(run, progress.step))
        listener.started(configuration, progress.step)
        with Interruption(listener.stopping) as interruption:
            recorder = _make_recorder(run, progress, listener, interruption)
            return _learn(model, configuration.steps - progress.step, recorder)
    finally:
        listener.ended()
        environments.close()


class _Stopped(Exception):  # noqa: N818
    """Leaves Stable-Baselines3's loop between two rollouts."""


def _learn(model: BaseAlgorithm, steps: int, recorder: Any) -> bool:
    if steps <= 0:
        return True
    try:
        model.learn(steps, callback=recorder, reset_num_timesteps=False)
    except _Stopped:
        return False
    finally:
        model.logger.close()
    return True


def _make_recorder(
    run: RunDirectory, progress: Progress, listener: Listener, interruption: Interruption
) -> Any:
    from stable_baselines3.common.callbacks import BaseCallback

    class Recorder(BaseCallback):
        """Evaluates, records and saves between rollouts: only there the model's state is whole."""

        def __init__(self) -> None:
            super().__init__()
            self.progress = progress

        def _on_step(self) -> bool:
            listener.advanced(self.num_timesteps)
            return True

        def _on_rollout_start(self) -> None:
            if self.model.num_timesteps >= self.progress.next_evaluation:
                self.record()
            if interruption.requested:
                self.progress = replace(self.progress, step=self.model.num_timesteps)
                _save_checkpoint(run, self.model, self.progress)
                raise _Stopped

        def _on_training_end(self) -> None:
            if self.model.num_timesteps > self.progress.step:
                self.record()

        def record(self) -> None:
            step, configuration = self.model.num_timesteps, run.configuration
            seeds = episode_seeds(TRAINING_SEEDS, configuration.evaluation_episodes)
            episodes = evaluate(lambda: make_configured(configuration), Learner(self.model), seeds)
            self.progress = self.progress.evaluated(
                step, episodes, configuration.evaluation_interval
            )
            _record(run, self.model, self.progress, episodes)
            listener.evaluated(step, summarise([episode.assessment for episode in episodes]))

    return Recorder()


def _record(
    run: RunDirectory, model: BaseAlgorithm, progress: Progress, episodes: Sequence[Episode]
) -> None:
    # In this order: rows after the newest checkpoint are removed when a run resumes, and a
    # checkpoint without its best policy writes it then.
    run.append(progress.step, episodes)
    _save_checkpoint(run, model, progress)
    if progress.best_step == progress.step:
        _save_policy(run, "best", model, progress)
    _save_policy(run, "last", model, progress)
    summary = summarise([episode.assessment for episode in episodes])
    scalars = {
        "assessment/PAM": summary.pam,
        "assessment/S": summary.safe,
        "assessment/S+T": summary.safe_target,
        "assessment/S+T+C": summary.safe_target_comfort,
        **{f"requirement/{label}": value for label, value in summary.requirements.items()},
    }
    for name, value in scalars.items():
        model.logger.record(name, value)
    model.logger.dump(progress.step)


def _save_checkpoint(run: RunDirectory, model: BaseAlgorithm, progress: Progress) -> None:
    from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

    with run.replacing("checkpoint") as folder:
        model.save(folder / MODEL)
        scale = model.get_vec_normalize_env()
        if scale is not None:
            scale.save(str(folder / REWARD_SCALE))
        if isinstance(model, OffPolicyAlgorithm):
            model.save_replay_buffer(folder / REPLAY)
        progress.save(folder)


def _save_policy(run: RunDirectory, which: Which, model: BaseAlgorithm, progress: Progress) -> None:
    with run.replacing_policy(which) as folder:
        model.save(folder / POLICY)
        content = {"trainer": "sb3", "step": progress.step, "file": POLICY}
        (folder / "policy.json").write_text(json.dumps(content) + "\n", encoding="utf-8")


def _make_vector(configuration: Configuration, folder: Path | None) -> VecEnv:
    """Environments with the task inside, so that shaping sees every episode's own end."""
    from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize

    count = configuration.parameters["environments"]
    vector: VecEnv = DummyVecEnv([lambda: _Terse(make_configured(configuration))] * count)
    vector = VecMonitor(vector)
    if not configuration.parameters["scale_reward"]:
        return vector
    if folder is not None:
        return VecNormalize.load(str(folder / REWARD_SCALE), vector)
    return VecNormalize(vector, norm_obs=False, gamma=configuration.parameters["gamma"])


class _Terse(gym.Wrapper[Any, Any, Any, Any]):
    """Empties `info`, which Stable-Baselines3 copies deeply at every step and no learner reads."""

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        observation, reward, terminated, truncated, _ = self.env.step(action)
        return observation, reward, terminated, truncated, {}


def _make_model(
    configuration: Configuration, environments: VecEnv, folder: Path | None
) -> BaseAlgorithm:
    import stable_baselines3

    name = algorithms.ALGORITHMS[configuration.algorithm].class_name
    kind: type[BaseAlgorithm] = getattr(stable_baselines3, name)
    if folder is not None:
        return _load_model(kind, environments, folder)
    try:
        return kind(
            _policy_name(environments.observation_space),
            environments,
            seed=configuration.seed,
            device="cpu",
            **_arguments(kind, configuration, environments),
        )
    except (AssertionError, ValueError, TypeError) as error:
        raise UsageError(f"Stable-Baselines3 refuses this training: {error}") from error


def _load_model(kind: type[BaseAlgorithm], environments: VecEnv, folder: Path) -> BaseAlgorithm:
    from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
    from stable_baselines3.common.utils import set_random_seed

    if not (folder / MODEL).is_file():
        raise RunError(f"{folder} holds no {MODEL}.")
    model = kind.load(folder / MODEL, env=environments, device="cpu")
    if isinstance(model, OffPolicyAlgorithm):
        model.load_replay_buffer(folder / REPLAY)
    # Loading has set the generators back to where the training began.
    set_random_seed(_derive_seed(model.seed or 0, model.num_timesteps))
    return model


def _arguments(
    kind: type[BaseAlgorithm], configuration: Configuration, environments: VecEnv
) -> dict[str, Any]:
    parameters = configuration.parameters
    own = hyperparameters(kind)
    chosen = {name: algorithms.schedule(parameters[name]) for name in own}
    chosen["policy_kwargs"] = {
        "net_arch": list(parameters["net_arch"]),
        **(parameters["policy_kwargs"] or {}),
    }
    if isinstance(chosen.get("train_freq"), list):
        chosen["train_freq"] = tuple(chosen["train_freq"])
    if "buffer_size" in chosen:
        # A longer buffer than the training would only take memory, and time at each checkpoint.
        chosen["buffer_size"] = min(chosen["buffer_size"], configuration.steps + 10_000)
    if parameters["action_noise"] > 0.0 and "action_noise" in _names(kind):
        from stable_baselines3.common.noise import NormalActionNoise

        shape = environments.action_space.shape or ()
        deviation = np.full(shape, parameters["action_noise"])
        chosen["action_noise"] = NormalActionNoise(np.zeros(shape), deviation)
    return chosen


def _names(kind: type[BaseAlgorithm]) -> Mapping[str, Any]:
    return inspect.signature(kind.__init__).parameters


def _policy_name(space: gym.Space[Any]) -> str:
    from stable_baselines3.common.preprocessing import is_image_space

    if isinstance(space, gym.spaces.Dict):
        return "MultiInputPolicy"
    return "CnnPolicy" if is_image_space(space) else "MlpPolicy"


def _make_logger(run: RunDirectory, step: int) -> Any:
    from stable_baselines3.common.logger import KVWriter, Logger
    from torch.utils.tensorboard.writer import SummaryWriter

    class Events(KVWriter):
        """TensorBoard's files; what was written after the checkpoint is marked as void."""

        def __init__(self) -> None:
            purge = step + 1 if step else None
            self.writer = SummaryWriter(str(run.events), purge_step=purge)

        def write(
            self,
            key_values: dict[str, Any],
            key_excluded: dict[str, tuple[str, ...]],
            step: int = 0,
        ) -> None:
            for key, value in key_values.items():
                number = isinstance(value, int | float | np.number)
                if number and "tensorboard" not in (key_excluded.get(key) or ()):
                    self.writer.add_scalar(key, value, step)
            self.writer.flush()

        def close(self) -> None:
            self.writer.close()

    return Logger(folder=str(run.events), output_formats=[Events()])


def _derive_seed(seed: int, step: int) -> int:
    """A seed that neighbouring seeds and later steps do not share."""
    return int(np.random.SeedSequence([seed, step]).generate_state(1)[0] >> 2)


def _stack(observations: Sequence[Any]) -> Any:
    first = observations[0]
    if isinstance(first, Mapping):
        return {key: _stack([observation[key] for observation in observations]) for key in first}
    return np.stack([np.asarray(observation) for observation in observations])
