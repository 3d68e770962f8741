"""How the state of an episode is packed into one array."""

from __future__ import annotations

import jax

from hprs.carsim.packed import Layout, layout_of
from hprs.envs.driving.simulation import Episode, Simulation

_FOUND: dict[tuple[object, ...], Layout[Episode]] = {}


def episode_layout(simulation: Simulation) -> Layout[Episode]:
    """The layout of a simulation's episodes."""
    shapes = simulation.settings.cars, simulation.beams, simulation.stacked
    key = (*shapes, simulation.tracks.centre.dtype)
    # JAX takes a tenth of a second to find it.
    if key not in _FOUND:
        _FOUND[key] = layout_of(
            jax.eval_shape(lambda seed: simulation.reset(seed)[0], jax.random.key(0))
        )
    return _FOUND[key]
