"""An ONNX file answers as the trainer's own network does, and as the bundle does."""

import jax
import jax.numpy as jnp
import numpy as np
import onnx
import onnxruntime
import pytest

from hprs.deploy import BoxLayout, ChoiceLayout, Layer, ObservationLayout
from hprs.deploy.archive import from_bytes, to_bytes
from hprs.deploy.onnx import OPSET, save_onnx, to_model
from hprs.errors import BundleError
from hprs.training.configure import configure
from hprs.training.environment import make_configured
from hprs.training.ppo.ppo_session import PpoSession
from hprs.training.sac.sac_session import SacSession
from hprs.training.signal_scale import signal_scale
from tests.deploy.small import box, numbers, small

COUNT = 10_000
TOLERANCE = 1e-5
INFINITE = float("inf")


class Ppo(PpoSession):
    """What has seen observations and learned something, at random."""

    def learned(self, member):
        found = self.shape.make(member)
        rows = np.random.default_rng(1).normal(0.3, 2.0, (100, self.shape.observation))
        seen = found.observations.updated(jnp.asarray(rows, jnp.float32), jnp.ones(100, bool))
        return found._replace(observations=seen, parameters=stirred(found.parameters))


class Sac(SacSession):
    """The same of SAC."""

    def learned(self, member):
        found = self.shape.make(member, self._configuration.parameters)
        return found._replace(parameters=stirred(found.parameters))


def stirred(parameters):
    """Weights that are not small, as after a training."""
    leaves, tree = jax.tree.flatten(parameters.policy)
    rng = np.random.default_rng(2)
    # Divided by the root of the inputs, so that units are neither still nor saturated.
    drawn = [rng.normal(0, len(leaf) ** -0.5, leaf.shape) for leaf in leaves]
    leaves = [
        leaf + jnp.asarray(more, jnp.float32) for leaf, more in zip(leaves, drawn, strict=True)
    ]
    return parameters._replace(policy=jax.tree.unflatten(tree, leaves))


def session_of(environment, algorithm):
    configuration = configure(environment, algorithm=algorithm)
    made = make_configured(configuration)
    if algorithm == "sac":
        return Sac(configuration, made)
    return Ppo(configuration, made, signal_scale(configuration.task))


def answers(model, observations):
    session = onnxruntime.InferenceSession(
        model.SerializeToString(), providers=["CPUExecutionProvider"]
    )
    return session.run(None, {"observation": observations})[0]


@pytest.mark.parametrize(
    ("environment", "algorithm"),
    [
        ("hprs/CartPole-v0", "ppo"),
        ("hprs/SafeDriving-v0", "ppo"),
        ("hprs/SafeDriving-v0", "sac"),
    ],
)
def test_it_acts_as_the_trainers_network_over_10_000_observations(environment, algorithm):
    session = session_of(environment, algorithm)
    learned = session.learned(0)
    rows = np.random.default_rng(3).normal(0.3, 2.0, (COUNT, session.shape.observation))
    space = session._observations
    rows = np.clip(rows, space.low, space.high).astype(np.float32)
    bundle = from_bytes(to_bytes(session.bundle(0, {})))
    found, wanted = answers(to_model(bundle), rows), session.shape.best(learned, jnp.asarray(rows))
    if isinstance(bundle.action, ChoiceLayout):
        outputs = bundle.network(bundle.observation.rows(rows))
        # Where two choices are equally good, rounding decides.
        decided = np.abs(outputs[:, 0] - outputs[:, 1]) > TOLERANCE
        assert decided.mean() > 0.999
        np.testing.assert_array_equal(found[decided], np.asarray(wanted)[decided])
        assert set(found) == {0, 1}
    else:
        np.testing.assert_allclose(found, wanted, rtol=0, atol=TOLERANCE)
        np.testing.assert_allclose(found, bundle.batch(rows), rtol=0, atol=TOLERANCE)
        assert np.std(found, axis=0).min() > 0.1


@pytest.mark.parametrize(
    "bundle",
    [
        small(action=ChoiceLayout(2, start=-3)),
        small(action=box(mapping="raw")),
        small(action=box(mapping="tanh"), activation="tanh"),
        small(action=box(low=(-INFINITE, 0), high=(INFINITE, INFINITE))),
        small(action=BoxLayout((2, 1), numbers(-1, -1), numbers(1, 2))),
        small(observation=ObservationLayout((1, 2), numbers(1, 0), numbers(2, 0.5), 1.5)),
        small(layers=(Layer(numbers([1, 0], [0, 1]), numbers(0, 0)),)),
    ],
)
def test_every_layout_is_the_bundles(bundle):
    seen = np.random.default_rng(0).normal(size=(1000, *bundle.observation.shape))
    seen = seen.astype(np.float32)
    found, wanted = answers(to_model(bundle), seen), bundle.batch(seen)
    assert (found.dtype, found.shape) == (wanted.dtype, wanted.shape)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=TOLERANCE)


def test_the_file_says_what_it_is(tmp_path):
    save_onnx(small(), tmp_path / "policy.onnx")
    model = onnx.load(tmp_path / "policy.onnx")
    assert [one.version for one in model.opset_import] == [OPSET]
    held = {one.key: one.value for one in model.metadata_props}
    assert held["rate"] == "10.0"
    assert held["provenance"] == '{"run": "x"}'
    with pytest.raises(BundleError, match=r"policy\.onnx cannot be written: No such file"):
        save_onnx(small(), tmp_path / "none" / "policy.onnx")
