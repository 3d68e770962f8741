from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hprs.carsim.packed import layout_of

TREE = {
    "flag": jnp.array([True, False]),
    "key": jnp.array([0xFFFFFFFF, 0x7FC00001], jnp.uint32),
    "number": jnp.int32(-7),
    "values": jnp.array([[1.5, -0.0, jnp.nan], [jnp.inf, 1e-44, 3.0]], jnp.float32),
}


def bits(leaf):
    return np.asarray(leaf).tobytes()


def test_packing_and_unpacking_changes_no_bit():
    layout = layout_of(TREE)
    packed = jax.jit(layout.pack)(TREE)
    assert packed.shape == (layout.size,)
    assert packed.dtype == jnp.uint32
    for back in (jax.jit(layout.unpack)(packed), layout.read(packed)):
        for name, leaf in TREE.items():
            assert back[name].shape == leaf.shape
            assert back[name].dtype == leaf.dtype
            assert bits(back[name]) == bits(leaf)


def test_a_layout_needs_shapes_only():
    assert layout_of(jax.eval_shape(lambda: TREE)) == layout_of(TREE)


def test_wider_types_are_refused():
    with pytest.raises(TypeError, match="not float64"):
        layout_of({"wide": np.zeros(2)})
