from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from vehiclemodels.utils.vehicle_dynamics_ks_cog import vehicle_dynamics_ks_cog
from vehiclemodels.vehicle_dynamics_st import vehicle_dynamics_st

from hprs.carsim.vehicle import (
    DYNAMIC_ABOVE,
    KINEMATIC_BELOW,
    TIME_STEP,
    Car,
    VehicleParameters,
    advance,
    at_rest,
    dynamic_share,
    rolling,
)

FIELDS = ("x", "y", "yaw", "speed", "yaw_rate", "slip", "steering")
NOMINAL = VehicleParameters()


@pytest.fixture
def float64():
    with jax.enable_x64(True):
        yield


def car_at(speed, steering=0.0, yaw_rate=0.0, slip=0.0, dtype=jnp.float32) -> Car:
    values = {"x": 0, "y": 0, "yaw": 0, "speed": speed, "yaw_rate": yaw_rate, "slip": slip}
    return Car(
        **{k: jnp.asarray(v, dtype) for k, v in values.items()},
        steering=jnp.asarray(steering, dtype),
    )


def driven(
    car: Car, inputs: np.ndarray, parameters=NOMINAL, time_step=TIME_STEP, substeps=1
) -> np.ndarray:
    """States after each row (acceleration, steering rate) of inputs, held for `substeps` steps."""

    def held(state, row):
        def step(_, inner):
            return advance(inner, row[0], row[1], parameters=parameters, time_step=time_step)

        state = jax.lax.fori_loop(0, substeps, step, state)
        return state, state

    _, states = jax.jit(lambda c, i: jax.lax.scan(held, c, i))(
        car, jnp.asarray(inputs, car.x.dtype)
    )
    return np.stack([np.asarray(getattr(states, name)) for name in FIELDS], axis=1)


def slalom(seconds=10.0, every=0.1, amplitude=0.6, acceleration=1.0) -> np.ndarray:
    """Inputs of a slalom, one row every 0.1 s."""
    time = np.arange(0, seconds, every)
    return np.stack([acceleration * np.sin(1.3 * time), amplitude * np.cos(2.0 * time)], axis=1)


def commonroad(model, start, inputs, parameters, every=0.1):
    """CommonRoad's own right-hand side, integrated to 1e-10 piece by piece; order of its states: x, y, steering,
    speed, yaw, yaw rate, slip."""
    tyre = SimpleNamespace(
        p_dy1=parameters.friction, p_ky1=-parameters.friction * parameters.front_stiffness
    )
    steering = SimpleNamespace(min=-0.4189, max=0.4189, v_min=-3.2, v_max=3.2)
    longitudinal = SimpleNamespace(v_min=-5.0, v_max=20.0, v_switch=7.319, a_max=9.51)
    p = SimpleNamespace(
        a=parameters.front_axle, b=parameters.rear_axle, h_s=parameters.height, m=parameters.mass,
        I_z=parameters.inertia, tire=tyre, steering=steering, longitudinal=longitudinal,
    )  # fmt: skip
    state, states = np.array(start, float), []
    for acceleration, steering_rate in inputs:
        u = [float(steering_rate), float(acceleration)]
        solution = solve_ivp(
            lambda _, x, u=u: model(x, u, p), (0, every), state, rtol=1e-10, atol=1e-12
        )
        state = solution.y[:, -1]
        states.append(state)
    return np.array(states)


def test_agrees_with_commonroads_single_track_model_over_10_s(float64):
    # CommonRoad has one stiffness for both axles, and no friction limit.
    parameters = replace(NOMINAL, rear_stiffness=NOMINAL.front_stiffness)
    inputs = slalom(amplitude=0.3)
    ours = driven(car_at(2.0, dtype=jnp.float64), inputs, parameters, substeps=10)
    theirs = commonroad(vehicle_dynamics_st, [0, 0, 0, 2.0, 0, 0, 0], inputs, parameters)
    assert ours[:, 3].min() > DYNAMIC_ABOVE
    assert np.abs(ours[:, 4]).max() > 1.0
    order = [theirs[:, i] for i in (0, 1, 4, 3, 5, 6, 2)]
    np.testing.assert_allclose(ours, np.stack(order, axis=1), rtol=0, atol=1e-4)


def test_agrees_with_commonroads_kinematic_model_at_low_speed_over_10_s(float64):
    inputs = slalom(acceleration=0.15)
    ours = driven(car_at(0.2, dtype=jnp.float64), inputs, substeps=10)
    theirs = commonroad(vehicle_dynamics_ks_cog, [0, 0, 0, 0.2, 0], inputs, NOMINAL)
    assert ours[:, 3].max() < KINEMATIC_BELOW
    assert np.abs(ours[:, 6]).max() > 0.2
    order = [theirs[:, i] for i in (0, 1, 4, 3, 2)]
    np.testing.assert_allclose(ours[:, [0, 1, 2, 3, 6]], np.stack(order, 1), rtol=0, atol=1e-7)


def test_the_integrator_converges_with_order_4(float64):
    inputs = slalom(amplitude=0.15)
    start = car_at(2.0, dtype=jnp.float64)
    runs = {n: driven(start, inputs, time_step=0.1 / n, substeps=n) for n in (10, 20, 320)}
    assert runs[320][:, 3].min() > DYNAMIC_ABOVE
    error = {n: np.abs(runs[n] - runs[320])[:, :2].max() for n in (10, 20)}
    assert error[10] < 1e-6
    assert np.log2(error[10] / error[20]) == pytest.approx(4, abs=0.4)


def test_the_error_at_the_default_step_is_small_where_the_models_blend(float64):
    inputs = slalom(amplitude=0.15, acceleration=1.5)
    start = car_at(0.4, dtype=jnp.float64)
    coarse, fine = (driven(start, inputs, time_step=0.1 / n, substeps=n) for n in (10, 320))
    assert fine[:, 3].min() < KINEMATIC_BELOW
    assert fine[:, 3].max() > DYNAMIC_ABOVE
    assert np.abs(coarse - fine)[:, :3].max() < 1e-5


def test_the_error_at_the_default_step_is_small_beyond_the_friction_limit(float64):
    inputs = slalom(amplitude=0.6)
    start = car_at(2.5, dtype=jnp.float64)
    coarse, fine = (driven(start, inputs, time_step=0.1 / n, substeps=n) for n in (10, 320))
    assert np.abs(fine[:, 5]).max() > 0.05
    assert np.abs(coarse - fine)[:, :3].max() < 1e-2


def test_single_precision_stays_within_a_millimetre_of_double_precision(float64):
    inputs = slalom(amplitude=0.3)
    single, double = (
        driven(car_at(2.0, dtype=d), inputs, substeps=10) for d in (jnp.float32, jnp.float64)
    )
    assert single.dtype == np.float32
    assert double.dtype == np.float64
    assert np.abs(single - double)[:, :2].max() < 1e-3


@pytest.mark.parametrize("speed", [2.0, 3.5, 5.0])
def test_a_steady_turn_has_the_yaw_rate_of_the_linear_theory(speed, float64):
    # Understeer gradient from the axles' loads and stiffnesses (Rajamani, Vehicle Dynamics and Control).
    steering = 0.02
    final = driven(car_at(speed, steering, dtype=jnp.float64), np.zeros((300, 2)))[-1]
    p = NOMINAL
    gradient = (1 / p.front_stiffness - 1 / p.rear_stiffness) / (p.friction * p.gravity)
    assert final[4] == pytest.approx(
        speed * steering / (p.wheelbase + gradient * speed**2), rel=1e-6
    )


@pytest.mark.parametrize(("speed", "steering"), [(3.5, 0.4), (5.0, 0.4189), (5.0, -0.4189)])
def test_lateral_acceleration_ends_at_the_friction_limit(speed, steering):
    states = driven(car_at(speed, steering), np.zeros((100, 2)))
    turned = np.diff(states[:, 2] + states[:, 5]) / TIME_STEP
    limit = NOMINAL.friction * NOMINAL.gravity
    assert np.abs(speed * turned).max() == pytest.approx(limit, rel=1e-3)


def test_positive_steering_turns_to_the_left():
    final = driven(car_at(1.0, 0.1), np.zeros((50, 2)))[-1]
    assert final[1] > 0
    assert final[2] > 0


def test_a_car_that_slides_and_stops_does_not_spin_in_place():
    inputs = np.concatenate([np.tile([-8.0, 0.0], (30, 1)), np.zeros((100, 2))])
    states = driven(car_at(2.4, 0.4, yaw_rate=5.0, slip=-0.3), inputs)
    assert abs(states[-1, 3]) < 1e-5
    assert abs(states[-1, 4]) < 1e-5
    np.testing.assert_allclose(states[-1, :3], states[-50, :3], atol=1e-4)


def test_reverse_is_kinematic():
    states = driven(car_at(-1.0, 0.2), np.zeros((300, 2)))
    turn, slip = rolling(car_at(-1.0, 0.2), parameters=NOMINAL)
    assert states[-1, 4] == pytest.approx(float(turn), rel=1e-4)
    assert states[-1, 5] == pytest.approx(float(slip), rel=1e-4)
    assert dynamic_share(jnp.float32(-3.0)) == 0.0


@given(
    speed=st.floats(-3, 6), steering=st.floats(-0.4189, 0.4189), yaw_rate=st.floats(-20, 20), slip=st.floats(-4, 4),
    acceleration=st.floats(-15, 15), friction=st.floats(0.2, 1.5), gravity=st.floats(9.81, 15), mass=st.floats(2.5, 6),
)  # fmt: skip
def test_every_finite_state_has_bounded_successors(
    speed, steering, yaw_rate, slip, acceleration, friction, gravity, mass
):
    parameters = VehicleParameters(friction=friction, gravity=gravity, mass=mass)
    final = _coasted(car_at(speed, steering, yaw_rate, slip), jnp.float32(acceleration), parameters)
    values = np.array([final.yaw_rate, final.slip, final.x, final.y, final.yaw])
    assert np.isfinite(values).all()
    # A stable integration cannot gain more than the tyres can give.
    assert abs(values[0]) < 25


@jax.jit
def _coasted(car, acceleration, parameters):
    car = advance(car, acceleration, jnp.float32(0.0), parameters=parameters)
    step = lambda _, c: advance(c, jnp.float32(0), jnp.float32(0), parameters=parameters)  # noqa: E731
    return jax.lax.fori_loop(0, 100, step, car)


def test_gradients_are_finite():
    @jax.jit
    @jax.vmap
    def gradient(car):
        return jax.grad(_sum_after_some_steps, argnums=(0, 1, 2))(car, jnp.zeros(2), NOMINAL)

    speeds, steering = np.meshgrid(
        [-1.0, 0.0, KINEMATIC_BELOW, 1.0, DYNAMIC_ABOVE, 5.0], [0.0, 0.4189]
    )
    cars = jax.tree.map(lambda leaf: jnp.full(speeds.size, leaf), car_at(0.0))
    cars = replace(cars, speed=jnp.float32(speeds.ravel()), steering=jnp.float32(steering.ravel()))
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(gradient(cars)))


def _sum_after_some_steps(car, inputs, parameters):
    def step(car, _):
        return advance(car, inputs[0], inputs[1], parameters=parameters), None

    car, _ = jax.lax.scan(step, car, length=5)
    return sum(jnp.sum(leaf) for leaf in jax.tree.leaves(car))


def test_a_batch_equals_its_cars_one_by_one():
    rng = np.random.default_rng(0)
    values = rng.uniform(-1, 1, (len(FIELDS), 8)).astype(np.float32)
    values[3] = np.linspace(0, 4, 8)
    batch = Car(**dict(zip(FIELDS, map(jnp.asarray, values), strict=True)))
    step = jax.jit(lambda car: advance(car, 1.0, 0.5, parameters=NOMINAL))
    together = jax.jit(jax.vmap(step))(batch)
    for i in range(8):
        alone = step(jax.tree.map(lambda leaf, i=i: leaf[i], batch))
        for name in FIELDS:
            np.testing.assert_allclose(
                getattr(together, name)[i], getattr(alone, name), rtol=1e-5, atol=1e-6
            )


def test_a_car_at_rest_stays_where_it_is():
    car = at_rest(jnp.float32(1.0), jnp.float32(2.0), jnp.float32(0.3))
    after = advance(car, jnp.float32(0), jnp.float32(0), parameters=NOMINAL)
    jax.tree.map(np.testing.assert_array_equal, after, car)
    np.testing.assert_array_equal(car.position, np.float32([1.0, 2.0]))
