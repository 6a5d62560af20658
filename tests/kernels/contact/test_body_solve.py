"""Contacts solved for what they move the bodies: laws and equation of motion in float64, and the other solver."""

import numpy as np
import pytest
import warp as wp

from otwarp.hydrodynamics import body_mobility
from otwarp.kernels.contact.blocks import block_count
from otwarp.kernels.contact.body_solve import SpaceRoom, fill_base_term, nodes_of, solve_bodies_term
from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.implicit_law import LAW_TOLERANCE
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import ModelData, mat66
from otwarp.simulation.packing.arrays import device_array
from tests.kernels.samples import quaternions
from tests.reference import contact_law
from tests.reference.body import jacobian
from tests.reference.rotations import matrix

FEATURES = Features(driver="world", bodies=3, rigid=True, obstacles=("plane",), pairs=True, body_space=True)
NODES, BLOCKS, BODIES, COUNT = nodes_of(FEATURES), block_count(nodes_of(FEATURES)), 3, 7
_fill, _solve = fill_base_term(FEATURES), solve_bodies_term(FEATURES)

PARTNERS = np.array([[1, 0], [1, -1], [2, -1], [2, 0], [2, 0], [2, 1], [2, 1]])
"""Two rigid bodies and a lone sphere, each with each other, and with obstacles."""

MOTION = 1e-4
"""Moves [µm, rad] beside those of the loads: lines of contacts that part may pull by what the law's tolerance lets
pass, a thousandth of the effective radius, while loads are cut off at the floor."""


@wp.kernel(enable_backward=False)
def probe_bodies(
    model: ModelData,
    position: wp.array(dtype=wp.vec3),
    rotation: wp.array(dtype=wp.quat),
    given: wp.array(dtype=Contact),
    linear: wp.array(dtype=wp.vec3),
    angular: wp.array(dtype=wp.vec3),
    again: bool,
    load: wp.array(dtype=float),
    error: wp.array(dtype=float),
):
    contacts = wp.zeros(shape=(COUNT,), dtype=Contact)
    for i in range(COUNT):
        contacts[i] = given[i]
    node = wp.zeros(shape=(wp.static(BODIES + 1),), dtype=int)
    base = wp.zeros(shape=(wp.static(3 * BODIES),), dtype=wp.mat33)
    block = wp.zeros(shape=(BLOCKS,), dtype=wp.mat33)
    filled = wp.zeros(shape=(NODES,), dtype=int)
    side = wp.zeros(shape=(NODES,), dtype=wp.vec3)
    moved = wp.zeros(shape=(NODES,), dtype=wp.vec3)
    opening = wp.zeros(shape=(COUNT,), dtype=float)
    depth = wp.zeros(shape=(COUNT,), dtype=float)
    space = SpaceRoom(node, base, block, filled, side, moved, opening, depth)
    _fill(model, 0, rotation, space)
    start = wp.zeros(shape=(wp.static(2 * BODIES),), dtype=wp.vec3)
    for b in range(BODIES):
        start[b] = linear[b]
        start[BODIES + b] = angular[b]
    error[0] = _solve(model, contacts, COUNT, position, False, linear, angular, space)
    if again:
        # the same step once more, from the lines that the first solution left
        for b in range(BODIES):
            linear[b] = start[b]
            angular[b] = start[BODIES + b]
        error[0] = _solve(model, contacts, COUNT, position, True, linear, angular, space)
    for i in range(COUNT):
        load[i] = contacts[i].load


class Problem:
    """Random contacts of three bodies in one step."""

    def __init__(self, seed: int, hardness: float):
        rng = np.random.default_rng(seed)
        self.move = body_mobility(np.array([[0.0, 0, 0], [2, 0, 0], [0, 2.5, 0]]), np.array([1.0, 1.0, 1.2]))
        self.scale, self.radius = 0.05, 0.4
        self.rotation = quaternions(rng, BODIES)
        self.rotation[2] = [0.0, 0.0, 0.0, 1.0]
        self.position = np.array([[0.0, 0, 0], [4, 1, 0], [1, 3, 2.0]])
        normal = rng.normal(size=(COUNT, 3))
        self.normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
        self.arms = rng.normal(size=(2, COUNT, 3))
        for i, (a, b) in enumerate(PARTNERS):
            if a == 2:  # forces on a sphere run through its centre
                self.arms[0, i] = 0.0
                self.arms[1, i] = self.position[2] - self.position[max(b, 0)] - 1.5 * self.normal[i]
        self.floor = -rng.uniform(0, 0.2, COUNT) * (rng.random(COUNT) < 0.5)
        self.free = rng.normal(size=(2, BODIES, 3)) * 0.02
        self.free[1, 2] = 0.0
        wander = np.where(rng.random(COUNT) < 0.5, -1e-3 * np.log(rng.random(COUNT)), 0.0)
        overlap = rng.uniform(-0.01, 0.03, COUNT)
        self.law = np.stack([overlap, hardness * rng.uniform(0.5, 1.0, COUNT), wander, np.full(COUNT, 0.008)], axis=1)
        self.law = self.law.astype(np.float32).astype(float)

    def mobility(self) -> np.ndarray:
        """(18, 18) M dt, body axes; the sphere does not turn."""
        m = np.kron(np.eye(BODIES), self.scale * self.move.mobility)
        m[12:] = m[:, 12:] = 0.0
        m[12:15, 12:15] = self.scale * self.move.mobility[0, 0] * np.eye(3)
        return m

    def rows(self) -> np.ndarray:
        """(n, 18) J: opening of each gap per motion of all bodies, body axes."""
        j = np.zeros((COUNT, 6 * BODIES))
        for i, (a, b) in enumerate(PARTNERS):
            for body, arm, sign in ((a, self.arms[0, i], 1.0), (b, self.arms[1, i], -1.0)):
                if body >= 0:
                    j[i, 6 * body : 6 * body + 6] += sign * jacobian(self.rotation[body], self.normal[i], arm)
        return j

    def turned(self, moves: np.ndarray) -> np.ndarray:
        """(18,) moves (2, bodies, 3) in world axes as twists in body axes."""
        return np.concatenate(
            [(matrix(q).T @ m.T).T.ravel() for q, m in zip(self.rotation, moves.swapaxes(0, 1), strict=True)]
        )

    def contacts(self, device: str) -> wp.array:
        give = np.diag(self.rows() @ self.mobility() @ self.rows().T)
        host = np.zeros(COUNT, dtype=Contact.numpy_dtype())
        host["a"], host["b"] = PARTNERS.T
        host["normal"], host["arm_a"], host["arm_b"] = self.normal, *self.arms
        host["radius"], host["give"], host["floor"] = self.radius, give, self.floor
        for k, name in enumerate(("overlap", "hardness", "wander", "layer")):
            host[name] = self.law[:, k]
        return wp.array(host, dtype=Contact, device=device)

    def solve(self, device: str, *, again: bool = False) -> tuple[np.ndarray, np.ndarray, float]:
        """Loads (n,), moves (2, bodies, 3) by the contacts, and the error told."""
        model = ModelData()
        model.time_step = 1e-3
        model.medium.viscosity = device_array([1e-3 / self.scale], wp.float32, device)
        model.body.shape = device_array([0] * BODIES, wp.int32, device)
        model.body.rigid = device_array([1, 1, 0], wp.int32, device)
        model.body.translation = device_array([self.move.mobility[0, 0]], wp.float32, device)
        model.body.resistance = device_array([self.move.resistance], mat66, device)
        moves = [device_array(v, wp.vec3, device) for v in self.free]
        load, error = (wp.zeros(n, dtype=float, device=device) for n in (COUNT, 1))
        poses = [device_array(self.position, wp.vec3, device), device_array(self.rotation, wp.quat, device)]
        inputs = [model, *poses, self.contacts(device), *moves, again, load, error]
        wp.launch(probe_bodies, dim=1, inputs=inputs, device=device)
        found = np.stack([m.numpy() for m in moves]).astype(float) - self.free
        return load.numpy().astype(float), found, float(error.numpy()[0])


@pytest.mark.parametrize("hardness", [2e2, 2e3, 2e5, 2e6], ids=["soft", "stiffer", "stiff", "hard"])
@pytest.mark.parametrize("again", [False, True], ids=["first stage", "second stage"])
def test_loads_obey_law_and_motion(hardness, again, device):
    """λ = λ(s⁰ + J M Jᵀλ) within the tolerance of the laws, and the moves are M Jᵀλ: float64, 12 random steps.

    With κ at a hundredth of the radius of 0.1 to 10³, the most that contacts are given.
    """
    pressed = 0
    for seed in range(12):
        problem = Problem(seed, hardness)
        load, moved, error = problem.solve(device, again=again)
        assert error == 0.0
        rows, mobility = problem.rows(), problem.mobility()
        motion = mobility @ rows.T @ load
        np.testing.assert_allclose(problem.turned(moved), motion, atol=MOTION)
        opening = rows @ (problem.turned(problem.free) + motion)
        give = np.diag(rows @ mobility @ rows.T)
        wanted = contact_law.loads(opening, problem.floor, problem.law, give)
        by_path = (
            wanted - problem.floor > problem.law[:, 1] * np.maximum(problem.law[:, 0] - opening, 0.0) ** 1.5 + 1e-4
        )
        stiff = 1.5 * problem.law[:, 1] * np.sqrt(np.maximum(problem.law[:, 0] - opening, 0.0)) * give
        missed = np.abs(load - wanted) * give
        allowed = np.where(by_path, 0.02 * 0.1, float(LAW_TOLERANCE) * problem.radius * (1.0 + stiff))
        assert np.all(missed <= allowed + MOTION * (1.0 + stiff))
        pressed += np.sum(load > problem.floor + 1e-3)
    assert pressed > 40
