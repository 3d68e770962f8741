import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from stable_baselines3.common.buffers import DictReplayBuffer, ReplayBuffer

from hprs.errors import RunError
from hprs.training import replay
from hprs.training.replay import load_segments, prune, write_segments
from hprs.training.sb3.ring import ReplayRing

BOX = spaces.Box(-1, 1, (3,), np.float32)
DICT = spaces.Dict({"near": BOX, "far": spaces.Box(0, 255, (2, 2), np.uint8)})


def make(space=BOX, size=40, environments=2):
    kind = DictReplayBuffer if isinstance(space, spaces.Dict) else ReplayBuffer
    action = spaces.Box(-1, 1, (2,), np.float32)
    return kind(size * environments, space, action, device="cpu", n_envs=environments)


def add(buffer, space, count, start=0):
    """Rows that differ from one another, the same ones for the same start."""
    generator = np.random.default_rng(start)
    space.seed(start)
    width = buffer.n_envs
    for _ in range(count):
        seen, then = (
            {key: np.stack([v[key] for v in values]) for key in values[0]}
            if isinstance(space, spaces.Dict)
            else np.stack(values)
            for values in ([space.sample() for _ in range(width)] for _ in range(2))
        )
        infos = [{"TimeLimit.truncated": bool(generator.integers(2))} for _ in range(width)]
        action = generator.uniform(-1, 1, (width, 2)).astype(np.float32)
        buffer.add(
            seen, then, action, generator.normal(size=width), infos_done(generator, width), infos
        )


def infos_done(generator, width):
    return generator.integers(0, 2, width)


def assert_sampled_alike(one, two):
    draws = []
    for buffer in (one, two):
        np.random.seed(3)  # noqa: NPY002
        draws.append(buffer.sample(64))
    for left, right in zip(*draws, strict=True):
        if isinstance(left, dict):
            assert all(left[key].equal(right[key]) for key in left)
        elif left is not None:
            assert left.equal(right)
    assert (one.pos, one.full) == (two.pos, two.full)


@pytest.fixture(autouse=True)
def small_segments(monkeypatch):
    """Ten rows of the small buffer a segment."""
    monkeypatch.setattr(replay, "SEGMENT_BYTES", 10 * ReplayRing(make(), 0).row_bytes)


@pytest.mark.parametrize("space", [BOX, DICT], ids=["box", "dict"])
@pytest.mark.parametrize("counts", [[0], [7], [25], [25, 3, 0, 30], [40], [33, 33, 33], [90, 55]])
def test_a_loaded_buffer_is_sampled_as_the_old_one(tmp_path, space, counts):
    buffer, segments, total = make(space), (), 0
    for count in counts:
        add(buffer, space, count, start=total)
        total += count
        segments = write_segments(tmp_path, ReplayRing(buffer, total), segments)
        prune(tmp_path, segments)
        loaded = make(space)
        load_segments(tmp_path, ReplayRing(loaded, total), segments)
        if total:
            assert_sampled_alike(buffer, loaded)


def test_a_checkpoint_writes_what_is_new_and_what_did_not_fill_a_segment(tmp_path):
    buffer = make()
    add(buffer, BOX, 25)
    first = write_segments(tmp_path, ReplayRing(buffer, 25), ())
    assert [(s.start, s.stop) for s in first] == [(0, 10), (10, 20), (20, 25)]
    add(buffer, BOX, 8, start=25)
    second = write_segments(tmp_path, ReplayRing(buffer, 33), first)
    assert [(s.start, s.stop) for s in second] == [(0, 10), (10, 20), (20, 30), (30, 33)]
    assert second[:2] == first[:2]
    assert write_segments(tmp_path, ReplayRing(buffer, 33), second) == second


def test_segments_that_the_buffer_has_forgotten_go_after_the_checkpoint(tmp_path):
    buffer = make()
    add(buffer, BOX, 40)
    first = write_segments(tmp_path, ReplayRing(buffer, 40), ())
    add(buffer, BOX, 15, start=40)
    (tmp_path / "rows-40-99.npz").write_text("left by a killed process")
    second = write_segments(tmp_path, ReplayRing(buffer, 55), first)
    assert {s.name for s in first} <= {file.name for file in tmp_path.iterdir()}
    prune(tmp_path, second)
    assert {file.name for file in tmp_path.iterdir()} == {s.name for s in second}
    assert [s.start for s in second] == [10, 20, 30, 40, 50]


def test_a_checkpoint_that_comes_late_writes_the_whole_buffer(tmp_path):
    buffer = make()
    add(buffer, BOX, 5)
    first = write_segments(tmp_path, ReplayRing(buffer, 5), ())
    add(buffer, BOX, 100, start=5)
    second = write_segments(tmp_path, ReplayRing(buffer, 105), first)
    assert (second[0].start, second[-1].stop) == (65, 105)


def test_a_damaged_segment_is_said(tmp_path):
    buffer = make()
    add(buffer, BOX, 5)
    [segment] = write_segments(tmp_path, ReplayRing(buffer, 5), ())
    file = tmp_path / segment.name
    file.write_bytes(file.read_bytes()[:-1])
    with pytest.raises(RunError, match=r"rows-0-5.npz is damaged"):
        load_segments(tmp_path, ReplayRing(make(), 5), [segment])
    file.unlink()
    with pytest.raises(RunError, match=r"rows-0-5.npz cannot be read: No such file"):
        load_segments(tmp_path, ReplayRing(make(), 5), [segment])


class Split(gym.ObservationWrapper):
    """Mountain car's observation as a dictionary."""

    def __init__(self):
        super().__init__(gym.make("MountainCarContinuous-v0").unwrapped)
        low, high = self.env.observation_space.low, self.env.observation_space.high
        self.observation_space = spaces.Dict(
            {
                "position": spaces.Box(low[:1], high[:1], dtype=np.float32),
                "velocity": spaces.Box(low[1:], high[1:], dtype=np.float32),
            }
        )

    def observation(self, observation):
        return {"position": observation[:1], "velocity": observation[1:]}


def test_a_training_on_dictionaries_resumes_bit_for_bit(tmp_path):
    from hprs.training import sb3
    from hprs.training.run_directory import create_runs

    from .small import Interrupter, configure_sb3, off_policy, same_numbers

    gym.register("Split-v0", Split)
    (tmp_path / "split.hprs").write_text(
        "signal p = obs.position[0] in [-1.2, 0.6]\nachieve top: p >= 0.45\n"
    )
    try:
        small = off_policy(tmp_path)
        configuration = configure_sb3(
            "Split-v0", algorithm="sac", task_path=str(tmp_path / "split.hprs"), steps=150, horizon=25,
            evaluation_interval=60, evaluation_episodes=1,
            settings={name: small.parameters[name] for name in ("environments", "learning_starts", "net_arch")},
        )  # fmt: skip
        whole, pieces = (create_runs([configuration], tmp_path / n)[0] for n in ("a", "b"))
        assert sb3.train(whole)
        assert not sb3.train(pieces, Interrupter(50))
        assert sb3.train(pieces)
        assert same_numbers(whole, pieces)
    finally:
        del gym.registry["Split-v0"]
