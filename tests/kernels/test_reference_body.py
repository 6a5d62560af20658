"""The NumPy twin of the time step of a rigid body."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.hydrodynamics import body_mobility
from tests.reference.body import advance, flow_velocity, free_move, implicit_move, jacobian, to_body
from tests.reference.contact_loads import contact_loads
from tests.reference.rotations import exponential, matrix, multiply

ETA, ENERGY, DT = 0.00089, 4.116e-3, 1e-4
OFFSETS = np.array([[0.0, 0, 0], [2, 0, 0], [4, 0, 0], [0, 2, 0], [0, 0, 1.5]])
BODY = body_mobility(OFFSETS, np.array([1.0, 1.0, 1.0, 1.0, 0.6]))


def move(wrench, noise=None, **kwargs):
    noise = np.zeros(6) if noise is None else noise
    settings = {"viscosity": ETA, "energy": ENERGY, "time_step": DT} | kwargs
    return free_move(np.asarray(wrench), BODY.mobility, BODY.cholesky, noise, **settings)


def test_quaternions():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=3), rng.normal(size=3)
    p, q = exponential(a), exponential(b)
    np.testing.assert_allclose(matrix(multiply(p, q)), matrix(p) @ matrix(q), atol=1e-14)
    np.testing.assert_allclose(matrix(q) @ b, b)  # the axis stays
    np.testing.assert_allclose(matrix(q) @ matrix(q).T, np.eye(3), atol=1e-14)
    quarter = exponential(np.array([0, 0, np.pi / 2]))
    np.testing.assert_allclose(matrix(quarter) @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_array_equal(exponential(np.zeros(3)), [0, 0, 0, 1])


def test_exponential_of_a_sum_about_one_axis():
    axis = np.array([0.6, 0.0, 0.8])
    np.testing.assert_allclose(multiply(exponential(0.3 * axis), exponential(1.1 * axis)), exponential(1.4 * axis))


def test_drift_is_mobility_times_force():
    wrench = np.arange(6.0)
    np.testing.assert_allclose(move(wrench), BODY.mobility @ wrench * DT / ETA)
    np.testing.assert_allclose(ETA / DT * BODY.resistance @ move(wrench), wrench, atol=1e-10)


def test_noise_has_the_covariance_of_fluctuation_dissipation():
    """Σ over the six unit deviates of Δ Δᵀ is the covariance: 2 k_B T M dt/η, for a step in which nothing turns."""
    step = 1e-12
    columns = np.stack([move(np.zeros(6), noise=e, time_step=step) for e in np.eye(6)], axis=1)
    scale = np.sqrt(np.outer(*[np.diag(BODY.mobility)] * 2)) * 2 * ENERGY * step / ETA
    np.testing.assert_allclose(columns @ columns.T / scale, 2 * ENERGY * BODY.mobility * step / ETA / scale, atol=1e-8)


@pytest.mark.parametrize("seed", range(3))
def test_equivariant_under_rotation_of_the_world(seed):
    rng = np.random.default_rng(seed)
    turn, q, x = exponential(rng.normal(size=3)), exponential(rng.normal(size=3)), rng.normal(size=3)
    force, torque, noise = rng.normal(size=3), rng.normal(size=3), rng.normal(size=6)
    r, turned_q = matrix(turn), multiply(turn, q)
    position, orientation = advance(x, q, move(to_body(q, force, torque), noise))
    position2, orientation2 = advance(r @ x, turned_q, move(to_body(turned_q, r @ force, r @ torque), noise))
    np.testing.assert_allclose(position2, r @ position, atol=1e-13)
    np.testing.assert_allclose(orientation2, multiply(turn, orientation), atol=1e-13)


def test_rotation_vector_of_the_world_or_of_the_body():
    """q ⊗ exp(θ_body) = exp(R θ_body) ⊗ q."""
    q, angle = exponential(np.array([0.4, 0.9, -1.0])), np.array([0.2, -0.1, 0.3])
    _, turned = advance(np.zeros(3), q, np.append(np.zeros(3), angle))
    np.testing.assert_allclose(turned, multiply(exponential(matrix(q) @ angle), q), atol=1e-15)


def test_body_follows_a_rigid_flow():
    q, x = exponential(np.array([0.3, -0.8, 0.5])), np.array([5.0, 1, -2])
    u, w = np.array([3.0, -1, 2]), np.array([0.4, 0.2, -0.7])
    points = [x + matrix(q) @ (o - BODY.reference) for o in OFFSETS]
    flow = flow_velocity(x, q, OFFSETS, BODY.flow_coupling, [(u + np.cross(w, p), w) for p in points])
    np.testing.assert_allclose(flow, to_body(q, u + np.cross(w, x), w), atol=1e-12)
    np.testing.assert_allclose(move(np.zeros(6), flow=flow), DT * flow)


def contact(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3)
    return jacobian(exponential(rng.normal(size=3)), normal / np.linalg.norm(normal), rng.normal(size=3) * 2)


def implicit(free, contacts):
    return implicit_move(free, BODY.resistance, contacts, viscosity=ETA, time_step=DT)


def test_without_stiffness_the_implicit_step_is_explicit():
    j, force = contact(0), 3.0
    np.testing.assert_allclose(implicit(move(np.ones(6)), [(force, 0.0, j)]), move(np.ones(6) + force * j), rtol=1e-10)


def test_a_hard_contact_does_not_give():
    j = contact(1)
    assert abs(j @ implicit(move(-100 * j), [(0.0, 1e12, j)])) < 1e-8 * abs(j @ move(-100 * j))


@pytest.mark.parametrize("stiffness", [1.0, 1e3, 1e6, 1e9])
def test_stable_for_any_stiffness(stiffness):
    """An overlap left alone decays without changing sign: by 1/(1 + k g), with g = Jᵀ M J dt/η."""
    j, overlap = contact(2), 0.01
    give = j @ BODY.mobility @ j * DT / ETA
    opened = j @ implicit(np.zeros(6), [(stiffness * overlap, stiffness, j)])
    assert overlap - opened == pytest.approx(overlap / (1 + stiffness * give), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_implicit_step_is_the_contact_loads_where_none_is_at_its_floor(seed):
    """Two ways to write backward Euler: (R η/dt + Σ k J Jᵀ) Δ, or loads λ = F − k s with Δ = Δ_free + M dt/η Σ λ J."""
    js = np.stack([contact(10 * seed + k) for k in range(3)])
    force, stiffness, free = np.array([5.0, 8.0, 2.0]), np.array([1e2, 1e4, 1e3]), move(np.ones(6))
    response = js @ BODY.mobility * (DT / ETA)
    loads = contact_loads(force, stiffness, np.full(3, -1e9), js @ free, response @ js.T)
    expected = free + response.T @ loads
    np.testing.assert_allclose(
        implicit(free, list(zip(force, stiffness, js, strict=True))), expected, rtol=1e-7, atol=1e-12
    )


def test_jacobian_is_the_motion_of_the_contact_point():
    """J · (Δx, Δθ) is the displacement along the normal of the material point, by finite rotation."""
    q, x, arm = exponential(np.array([0.7, -0.2, 0.4])), np.array([1.0, 2, 3]), np.array([0.5, -1.5, 0.8])
    normal, h = np.array([0.48, 0.6, 0.64]), 1e-6
    j = jacobian(q, normal, arm)
    for k in range(6):
        position, turned = advance(x, q, h * np.eye(6)[k])
        point = position + matrix(turned) @ (matrix(q).T @ arm)
        assert (point - x - arm) @ normal / h == pytest.approx(j[k], abs=1e-5)
