"""The driving benchmarks as pure JAX functions, for trainers that run on the device.

```python
simulation = make("hprs/SafeDriving-v0", tracks="gm")
episode, observation, signals = simulation.reset(key)
episode, observation, signals, env_reward, terminated, truncated = simulation.step(episode, action)
```

The functions are of one episode; `jax.vmap` makes a batch. A simulation is a tree of arrays:
passed to compiled functions as an argument, tracks of equal shapes share one compilation. Nothing
resets by itself.
"""

from __future__ import annotations

from typing import Any

from hprs.envs.driving.options import simulate
from hprs.envs.driving.simulation import Episode as Episode
from hprs.envs.driving.simulation import Signals as Signals
from hprs.envs.driving.simulation import Simulation as Simulation
from hprs.envs.follow_leader.env import DEFAULTS as _FOLLOW_LEADER
from hprs.envs.safe_driving.env import DEFAULTS as _SAFE_DRIVING
from hprs.errors import UsageError, did_you_mean

__all__ = ["FUNCTIONAL", "Episode", "Signals", "Simulation", "make"]

FUNCTIONAL = {"hprs/SafeDriving-v0": _SAFE_DRIVING, "hprs/FollowLeader-v0": _FOLLOW_LEADER}
"""Environment id to its default options."""


def make(environment: str, **options: Any) -> Simulation:
    """A benchmark as pure functions.

    Args:
        environment: One of `FUNCTIONAL`.
        **options: As in `gymnasium.make`, and `horizon`.

    Raises:
        UsageError: There is no such environment or option.
        TrackError: A map file cannot be read or driven.
    """
    if environment not in FUNCTIONAL:
        raise UsageError(
            f"'{environment}' does not exist as JAX functions."
            f"{did_you_mean(environment, FUNCTIONAL)} There are {', '.join(FUNCTIONAL)}."
        )
    return simulate(FUNCTIONAL[environment], **options)
