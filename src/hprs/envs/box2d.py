"""Box2D and what Gymnasium builds of it, imported here only, with a hint where it is missing."""

from __future__ import annotations

from hprs.errors import MissingExtraError

try:
    import Box2D as Box2D
    from gymnasium.envs.box2d import bipedal_walker as bipedal_walker
    from gymnasium.envs.box2d import lunar_lander as lunar_lander
except ModuleNotFoundError as error:
    if error.name != "Box2D":
        raise
    raise MissingExtraError("Box2D", "box2d") from None

__all__ = ["Box2D", "bipedal_walker", "lunar_lander"]
