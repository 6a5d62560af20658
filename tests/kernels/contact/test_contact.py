"""Contact on the device against its twins: the force law, and the solver against an exact one."""

import numpy as np
import pytest
import warp as wp

from otwarp.hydrodynamics import body_mobility
from otwarp.kernels.contact.contact import Contact, along, overlap_alone, pair_law, pair_reach, rigid_response
from otwarp.kernels.contact.solve import solve_contacts
from otwarp.kernels.core.types import BodyData, ContactData, mat66
from otwarp.scene import Material
from otwarp.simulation.arrays import device_array
from tests.kernels.samples import evaluate, on_device, quaternions
from tests.reference import contact as twin
from tests.reference.body import jacobian
from tests.reference.contact import adhesion_of, sphere_obstacle, sphere_pair
from tests.reference.contact_loads import contact_loads
from tests.reference.rotations import matrix

FORCE = 2e-5
"""float32 force relative to the parts it is made of: the overlap δ, a difference of lengths of order 1, to the 3/2."""

SOLVED = 2e-5
"""Loads relative to the largest: a factorisation in float32 of matrices whose condition is up to some hundreds."""

MATERIALS = (
    Material(youngs_modulus=1e3, poisson_ratio=0.45, adhesion=0.5, adhesion_range=0.05),
    Material(youngs_modulus=1e6, poisson_ratio=0.4),
    Material(youngs_modulus=5e3, poisson_ratio=0.3, adhesion=0.1, adhesion_range=0.2),
    Material(youngs_modulus=2e3, poisson_ratio=0.3, adhesion=0.5, adhesion_range=0.02),
)
COUNT = 5
SQUARE = COUNT * COUNT
BODIES = 3


@wp.kernel(enable_backward=False)
def probe_law(
    contact: ContactData,
    a: wp.array(dtype=int),
    b: wp.array(dtype=int),
    radius: wp.array(dtype=float),
    overlap: wp.array(dtype=float),
    out: wp.array(dtype=wp.vec4),
):
    i = wp.tid()
    law = pair_law(contact, a[i], b[i], radius[i], overlap[i])
    out[i] = wp.vec4(law.force, law.stiffness, law.floor, pair_reach(contact, a[i], b[i]))


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
        c.drift = given[i, 3]
        c.normal = normal[i]
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
        load[i] = contacts[i].load
    for b in range(BODIES):
        moved[b, 0] = d[b]
        moved[b, 1] = t[b]


def surfaces(device: str) -> ContactData:
    data = ContactData()
    data.compliance = device_array([(1 - m.poisson_ratio**2) / m.youngs_modulus for m in MATERIALS], wp.float32, device)
    data.adhesion = device_array([m.adhesion for m in MATERIALS], wp.float32, device)
    data.adhesion_range = device_array([m.adhesion_range for m in MATERIALS], wp.float32, device)
    return data


def test_force_law_is_that_of_the_twin(device):
    """Hertz repulsion, adhesion with and without contact, out of range; spheres and obstacles; every pair."""
    rng, n = np.random.default_rng(0), 3000
    a, b = rng.integers(0, 4, n), rng.integers(-1, 4, n)
    radius = rng.uniform(0.3, 3.0, n).astype(np.float32)
    overlap = rng.uniform(-0.25, 0.3, n).astype(np.float32)
    overlap[:50] = 0.0
    given = on_device(device, (a, int), (b, int), (radius, float), (overlap, float))
    (got,) = evaluate(probe_law, n, [surfaces(device), *given], [wp.vec4], device)
    for i in range(n):
        r, d, ma = float(radius[i]), float(overlap[i]), MATERIALS[a[i]]
        if b[i] < 0:
            force, stiffness = sphere_obstacle(ma, r, r - d)
            work, reach = ma.adhesion, ma.adhesion_range
        else:
            mb = MATERIALS[b[i]]
            # two spheres of twice the radius have the effective radius r
            force, stiffness = sphere_pair(ma, 2 * r, mb, 2 * r, 4 * r - d)
            work, reach = adhesion_of(ma, mb)
        pull = 2 * np.pi * r * work
        assert got[i, 0] == pytest.approx(force, abs=FORCE * (abs(force) + pull + 1e-6) + FORCE * stiffness * 0.01)
        # at δ = 0 the stiffness is a root of rounding
        assert got[i, 1] == pytest.approx(stiffness, rel=1e-4, abs=1e-3 if d == 0 else 1e-9)
        assert got[i, 2] == pytest.approx(-pull, rel=1e-6)
        if work > 0.0:
            assert got[i, 3] >= np.float32(reach) * (1 - 1e-6)  # the search reaches at least as far as the law
        elif b[i] < 0 or MATERIALS[b[i]].adhesion == 0.0:
            assert got[i, 3] == 0.0


@wp.kernel(enable_backward=False)
def probe_alone(
    hardness: wp.array(dtype=float),
    give: wp.array(dtype=float),
    reach: wp.array(dtype=float),
    out: wp.array(dtype=float),
):
    i = wp.tid()
    out[i] = overlap_alone(hardness[i], give[i], reach[i])


def test_a_lone_contact_ends_where_backward_euler_takes_it(device):
    """Five of Newton's steps from above: to float32 rounding from the softest contact to the hardest."""
    rng, n = np.random.default_rng(4), 2000
    given = [(10.0 ** rng.uniform(*r, n)).astype(np.float32) for r in ((-2, 11), (-8, 1), (-7, 1))]
    (got,) = evaluate(probe_alone, n, on_device(device, *((v, float) for v in given)), [float], device)
    expected = [twin.overlap_alone(*map(float, row)) for row in zip(*given, strict=True)]
    np.testing.assert_allclose(got, expected, rtol=1e-5)


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

    def rows(self) -> np.ndarray:
        """(n, 6·bodies) J: opening of each gap per motion of all bodies, body axes."""
        j = np.zeros((COUNT, 6 * BODIES))
        for i, (a, b) in enumerate(self.partners):
            j[i, 6 * a : 6 * a + 6] += jacobian(self.rotation[a], self.normal[i], self.arms[0, i])
            if b >= 0:
                j[i, 6 * b : 6 * b + 6] -= jacobian(self.rotation[b], self.normal[i], self.arms[1, i])
        return j

    def exact(self) -> np.ndarray:
        j = self.rows()
        mobility = self.scale * np.kron(np.eye(BODIES), self.move.mobility)
        # the free opening, point by point in world axes: independent of J
        free = -self.drift
        for i, (a, b) in enumerate(self.partners):
            for body, arm, sign in ((a, self.arms[0, i], 1.0), (b, self.arms[1, i], -1.0)):
                if body >= 0:
                    point = self.free[0, body] + np.cross(self.free[1, body].astype(float), arm)
                    free[i] += sign * point @ self.normal[i]
        return contact_loads(self.force, self.stiffness, self.floor, free, j @ mobility @ j.T)

    def solve(self, device: str) -> tuple[np.ndarray, np.ndarray]:
        """Loads (n,) and motions (bodies, 2, 3) of the device."""
        body = BodyData()
        body.shape = device_array([0] * BODIES, wp.int32, device)
        body.mobility = device_array([self.move.mobility], mat66, device)
        given = np.stack([self.force, self.stiffness, self.floor, self.drift, np.full(COUNT, self.scale)], axis=1)
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
