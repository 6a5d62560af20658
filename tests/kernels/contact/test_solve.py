"""The solver of contacts against an exact one."""

import numpy as np
import pytest
import warp as wp

from otwarp.hydrodynamics import body_mobility
from otwarp.kernels.contact.contact import Contact, along, rigid_response
from otwarp.kernels.contact.excursion import LAYER
from otwarp.kernels.contact.solve import solve_contacts
from otwarp.kernels.core.types import BodyData, mat66
from otwarp.simulation.packing.arrays import device_array
from tests.kernels.contact.test_excursion import ENERGY
from tests.kernels.samples import quaternions
from tests.reference.body import jacobian
from tests.reference.contact import overlap_alone
from tests.reference.contact_loads import contact_loads
from tests.reference.rotations import matrix

SOLVED = 2e-5
"""Loads relative to the largest: a factorisation in float32 of matrices whose condition is up to some hundreds."""


COUNT = 5


SQUARE = COUNT * COUNT


BODIES = 3


@wp.kernel(enable_backward=False)
def probe_solve(
    body: BodyData,
    rotation: wp.array(dtype=wp.quat),
    partners: wp.array2d(dtype=int),
    given: wp.array2d(dtype=float),
    normal: wp.array(dtype=wp.vec3),
    arm_a: wp.array(dtype=wp.vec3),
    arm_b: wp.array(dtype=wp.vec3),
    linear: wp.array(dtype=wp.vec3),
    angular: wp.array(dtype=wp.vec3),
    load: wp.array(dtype=float),
    error: wp.array(dtype=float),
    moved: wp.array2d(dtype=wp.vec3),
):
    contacts = wp.zeros(shape=(COUNT,), dtype=Contact)
    d = wp.zeros(shape=(BODIES,), dtype=wp.vec3)
    t = wp.zeros(shape=(BODIES,), dtype=wp.vec3)
    for b in range(BODIES):
        d[b] = linear[b]
        t[b] = angular[b]
    for i in range(COUNT):
        c = Contact()
        c.a = partners[i, 0]
        c.b = partners[i, 1]
        c.force = given[i, 0]
        c.stiffness = given[i, 1]
        c.floor = given[i, 2]
        c.normal = normal[i]
        c.drift = given[i, 3] * c.normal
        c.overlap = given[i, 5]
        c.hardness = given[i, 6]
        c.wander = given[i, 7]
        c.layer = given[i, 8]
        c.radius = 1.0
        # its number, because contacts may change places
        c.curvature = float(i)
        c.arm_a = arm_a[i]
        c.arm_b = arm_b[i]
        c.response_a = rigid_response(body, c.a, rotation[c.a], given[i, 4], c.arm_a, c.normal)
        c.give = along(c.response_a, c.arm_a, c.normal)
        if c.b >= 0:
            c.response_b = rigid_response(body, c.b, rotation[c.b], given[i, 4], c.arm_b, -c.normal)
            c.give -= along(c.response_b, c.arm_b, c.normal)
        contacts[i] = c
    matrix = wp.zeros(shape=(SQUARE,), dtype=float)
    free = wp.zeros(shape=(COUNT,), dtype=float)
    right = wp.zeros(shape=(COUNT,), dtype=float)
    pivot = wp.zeros(shape=(COUNT,), dtype=float)
    order = wp.zeros(shape=(COUNT,), dtype=int)
    on = wp.zeros(shape=(COUNT,), dtype=int)
    error[0] = solve_contacts(contacts, COUNT, d, t, matrix, free, right, pivot, order, on)
    for i in range(COUNT):
        load[int(contacts[i].curvature)] = contacts[i].load
    for b in range(BODIES):
        moved[b, 0] = d[b]
        moved[b, 1] = t[b]


class Problem:
    """Five random contacts among three rigid bodies and obstacles, with the exact solution of the step."""

    def __init__(self, seed: int, stiffness: tuple[float, float]):
        rng = np.random.default_rng(seed)
        self.move = body_mobility(np.array([[0.0, 0, 0], [2, 0, 0], [0, 2.5, 0]]), np.array([1.0, 1.0, 1.2]))
        self.rotation = quaternions(rng, BODIES)
        self.partners = np.array([[0, 1], [1, 2], [2, 0], [0, -1], [2, -1]])
        normal = rng.normal(size=(COUNT, 3))
        self.normal = (normal / np.linalg.norm(normal, axis=1, keepdims=True)).astype(np.float32)
        self.arms = rng.normal(size=(2, COUNT, 3)).astype(np.float32)
        self.scale = 0.05  # dt/η, so that a unit force moves a body by some nm
        self.stiffness = 10.0 ** rng.uniform(*stiffness, COUNT)
        self.force = rng.normal(size=COUNT) * 3.0
        self.floor = -rng.uniform(0, 2, COUNT) * (rng.random(COUNT) < 0.5)
        self.drift = np.where(self.partners[:, 1] < 0, rng.normal(size=COUNT) * 0.01, 0.0)
        self.free = (rng.normal(size=(2, BODIES, 3)) * 0.02).astype(np.float32)
        # overlap, K, wander and layer; without K the lines are given
        self.law = np.zeros((COUNT, 4))

    def rows(self) -> np.ndarray:
        """(n, 6·bodies) J: opening of each gap per motion of all bodies, body axes."""
        j = np.zeros((COUNT, 6 * BODIES))
        for i, (a, b) in enumerate(self.partners):
            j[i, 6 * a : 6 * a + 6] += jacobian(self.rotation[a], self.normal[i], self.arms[0, i])
            if b >= 0:
                j[i, 6 * b : 6 * b + 6] -= jacobian(self.rotation[b], self.normal[i], self.arms[1, i])
        return j

    def exact(self) -> np.ndarray:
        free, give = self.openings()
        return contact_loads(self.force, self.stiffness, self.floor, free, give)

    def openings(self) -> tuple[np.ndarray, np.ndarray]:
        """(n,) free openings [µm] and (n, n) openings by unit forces [µm/pN]."""
        j = self.rows()
        mobility = self.scale * np.kron(np.eye(BODIES), self.move.mobility)
        # the free opening, point by point in world axes: independent of J
        free = -self.drift
        for i, (a, b) in enumerate(self.partners):
            for body, arm, sign in ((a, self.arms[0, i], 1.0), (b, self.arms[1, i], -1.0)):
                if body >= 0:
                    point = self.free[0, body] + np.cross(self.free[1, body].astype(float), arm)
                    free[i] += sign * point @ self.normal[i]
        return free, j @ mobility @ j.T

    def solve(self, device: str) -> tuple[np.ndarray, np.ndarray]:
        """Loads (n,) and motions (bodies, 2, 3) of the device."""
        body = BodyData()
        body.shape = device_array([0] * BODIES, wp.int32, device)
        body.mobility = device_array([self.move.mobility], mat66, device)
        given = np.stack([self.force, self.stiffness, self.floor, self.drift, np.full(COUNT, self.scale)], axis=1)
        given = np.concatenate([given, self.law], axis=1)
        load, error = wp.zeros(COUNT, dtype=float, device=device), wp.zeros(1, dtype=float, device=device)
        moved = wp.zeros((BODIES, 2), dtype=wp.vec3, device=device)
        inputs = [
            body,
            device_array(self.rotation, wp.quat, device),
            device_array(self.partners, wp.int32, device, ndim=2),
            device_array(given, wp.float32, device, ndim=2),
            *(device_array(v, wp.vec3, device) for v in (self.normal, *self.arms)),
            *(device_array(v, wp.vec3, device) for v in self.free),
            load,
            error,
            moved,
        ]
        wp.launch(probe_solve, dim=1, inputs=inputs, device=device)
        assert error.numpy()[0] == 0.0
        return load.numpy().astype(float), moved.numpy().astype(float)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("stiffness", [(-1.0, 1.0), (1.0, 4.0)], ids=["soft", "hard"])
def test_loads_are_those_of_the_exact_solver(seed, stiffness, device):
    problem = Problem(seed, stiffness)
    exact = problem.exact()
    got, _ = problem.solve(device)
    assert np.abs(got - exact).max() < SOLVED * max(np.abs(exact).max(), np.abs(problem.force).max())
    assert np.all(got >= problem.floor.astype(np.float32))


def test_some_contacts_rest_on_their_floor_and_some_do_not():
    """The problems above meet both branches of the solver."""
    at_floor = np.concatenate([p.exact() == p.floor for p in (Problem(s, (1.0, 4.0)) for s in range(6))])
    assert 0.1 < at_floor.mean() < 0.9


def test_motion_is_that_of_the_loads(device):
    """Every load acts on both partners with opposite sign: what the bodies moved is M dt/η Σ λ J of the loads found."""
    problem = Problem(1, (1.0, 4.0))
    load, moved = problem.solve(device)
    j = problem.rows()
    for b in range(BODIES):
        wrench = load @ j[:, 6 * b : 6 * b + 6]
        expected = problem.scale * problem.move.mobility @ wrench
        got = moved[b] - problem.free[:, b]
        back = np.concatenate([rotate_back(problem.rotation[b], got[0]), rotate_back(problem.rotation[b], got[1])])
        np.testing.assert_allclose(back, expected, atol=1e-6 * max(1.0, np.abs(expected).max()))


def rotate_back(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return matrix(q.astype(float)).T @ v


def test_a_hard_contact_lets_nothing_through(device):
    """One contact of stiffness → ∞ that closes freely: the load undoes the approach, and a parting one carries none."""
    problem = Problem(2, (8.0, 8.0))
    problem.partners[:] = [0, -1]
    problem.force[:], problem.floor[:], problem.drift[:] = 0.0, 0.0, 0.0
    problem.normal[:], problem.arms[:] = problem.normal[0], problem.arms[:, :1]
    problem.free[:] = 0.0
    for closing in (True, False):
        problem.free[0, 0] = (-0.02 if closing else 0.02) * problem.normal[0]
        load, moved = problem.solve(device)
        point = moved[0, 0] + np.cross(moved[0, 1], problem.arms[0, 0])
        opening = float(point @ problem.normal[0])
        assert opening == pytest.approx(0.0 if closing else 0.02, abs=1e-7)
        assert (load.sum() > 0.0) == closing


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("hardness", [1e4, 1e9], ids=["soft", "hard"])
def test_drawn_paths_are_kept_out_together(seed, hardness, device):
    """Every load obeys the law of its own path, (give·λ + g₀ + δ + layer)·(g + δ + layer) = W/4, g the gap at the end
    by all loads, or Hertz's where that asks for more; to a twentieth of the end, or 10⁻³ of the radius."""
    problem = Problem(seed, (1.0, 1.0))
    rng = np.random.default_rng(seed)
    problem.force[:], problem.stiffness[:], problem.floor[:] = 0.0, 0.0, 0.0
    free, give = problem.openings()
    own = np.diag(give)
    variance = 2.0 * ENERGY * own
    layer = np.full(COUNT, LAYER * (2.5 * ENERGY / hardness) ** 0.4)
    gap = rng.exponential(np.sqrt(variance)) * 0.3
    wander = -2.0 * variance * np.log(rng.random(COUNT))
    problem.law = np.stack([-gap, np.full(COUNT, hardness), wander, layer], axis=1)
    load, _ = problem.solve(device)
    apart = free + give @ load - own * load
    size = np.hypot(apart, np.sqrt(wander))
    end = 0.5 * (size + apart)
    kept = np.maximum(end - layer, 0.0) - gap - apart
    for i in range(COUNT):
        exact = hardness * overlap_alone(hardness, own[i], kept[i]) ** 1.5 if kept[i] > 0.0 else 0.0
        assert abs(load[i] - exact) * own[i] < 0.05 * end[i] + 1e-3 * (end[i] < layer[i]) + 2e-6
    assert np.count_nonzero(load > 0.0) > 0
