"""Contacts solved for what they move the bodies: laws and equation of motion in float64, and the other solver."""

import numpy as np
import pytest
import warp as wp

from otwarp.hydrodynamics import body_mobility
from otwarp.kernels.contact.blocks import block_count
from otwarp.kernels.contact.body_solve import SpaceRoom, nodes_of, solve_bodies_term
from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.contact_list import ContactList, put_term, solved_term
from otwarp.kernels.contact.travel import opening_of
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import ModelData, Move, ReadoutData, mat66
from otwarp.simulation.packing.arrays import device_array
from tests.kernels.contact.test_contact_list import empty_list
from tests.kernels.samples import quaternions
from tests.reference import contact_law
from tests.reference.body import jacobian
from tests.reference.rotations import matrix

FEATURES = Features(
    driver="world", bodies=3, rigid=True, obstacles=("plane",), pairs=True, body_space=True, max_contacts=8
)
NODES, BLOCKS, BODIES, COUNT = nodes_of(FEATURES), block_count(nodes_of(FEATURES)), 3, 7
_put, _solve, _solved = (t(FEATURES) for t in (put_term, solve_bodies_term, solved_term))

PARTNERS = np.array([[1, 0], [1, -1], [2, -1], [2, 0], [2, 0], [2, 1], [2, 1]])
"""Two rigid bodies and a lone sphere, each with each other, and with obstacles."""

MOTION = 8e-5
"""Moves [µm, rad] beside those of the loads: what may be out of balance, and its rotations."""


HARDNESS = pytest.mark.parametrize("hardness", [2e2, 2e3, 2e5, 2e6], ids=["soft", "stiffer", "stiff", "hard"])
AGAIN = pytest.mark.parametrize("again", [False, True], ids=["first stage", "second stage"])


@wp.struct
class Pressed:
    """A step whose contacts are to be solved: where the bodies are, how they go if free, and what is found."""

    position: wp.array(dtype=wp.vec3)
    rotation: wp.array(dtype=wp.quat)
    given: wp.array(dtype=Contact)
    linear: wp.array(dtype=wp.vec3)  # free moves; on return, those by the contacts as well
    angular: wp.array(dtype=wp.vec3)
    start: wp.array(dtype=wp.vec3)  # the free moves, kept
    again: bool  # solve the step once more, from the solution of the first time
    listed: ContactList
    load: wp.array(dtype=float)
    error: wp.array(dtype=float)


@wp.func
def listed_one(p: Pressed, count: int, i: int) -> int:
    """List contact i, with its opening by the free moves; the new count."""
    c = p.given[i]
    other = wp.max(c.b, 0)
    opening = opening_of(c, Move(p.linear[c.a], p.angular[c.a]), Move(p.linear[other], p.angular[other]))
    return _put(ReadoutData(), 0, p.listed, count, c, opening, wp.int64(0))


@wp.func
def listed_of(p: Pressed):
    """List the contacts, with their openings by the free moves."""
    count = 0
    for i in range(COUNT):
        count = listed_one(p, count, i)


@wp.func
def freed(p: Pressed):
    """Set the moves back to the free ones."""
    for b in range(BODIES):
        p.linear[b] = p.start[b]
        p.angular[b] = p.start[BODIES + b]


@wp.func
def loads_of(p: Pressed):
    """Report the loads of all contacts."""
    for i in range(COUNT):
        p.load[i] = _solved(p.listed, i).load


@wp.kernel(enable_backward=False)
def probe_bodies(model: ModelData, p: Pressed):
    node = wp.zeros(shape=(wp.static(BODIES + 1),), dtype=int)
    block = wp.zeros(shape=(BLOCKS,), dtype=wp.mat33)
    filled = wp.zeros(shape=(NODES,), dtype=int)
    side = wp.zeros(shape=(NODES,), dtype=wp.vec3)
    moved = wp.zeros(shape=(NODES,), dtype=wp.vec3)
    space = SpaceRoom(node, block, filled, side, moved)
    listed_of(p)
    p.error[0] = _solve(model, 0, p.listed, COUNT, p.position, p.rotation, False, p.linear, p.angular, space)
    if p.again:
        freed(p)
        p.error[0] = _solve(model, 0, p.listed, COUNT, p.position, p.rotation, True, p.linear, p.angular, space)
    loads_of(p)


class Problem:
    """Random contacts of three bodies in one step."""

    def __init__(self, seed: int, hardness: float, partners: np.ndarray = PARTNERS):
        self.partners = partners
        rng = np.random.default_rng(seed)
        self.move = body_mobility(np.array([[0.0, 0, 0], [2, 0, 0], [0, 2.5, 0]]), np.array([1.0, 1.0, 1.2]))
        self.scale, self.radius = 0.05, 0.4
        self.rotation = quaternions(rng, BODIES)
        self.rotation[2] = [0.0, 0.0, 0.0, 1.0]
        self.position = np.array([[0.0, 0, 0], [4, 1, 0], [1, 3, 2.0]])
        normal = rng.normal(size=(COUNT, 3))
        self.normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
        self.arms = rng.normal(size=(2, COUNT, 3))
        for i, (a, b) in enumerate(self.partners):
            if a == 2:  # forces on a sphere run through its centre
                self.arms[0, i] = 0.0
            if b >= 0:  # and all through both arms
                self.arms[1, i] = self.arms[0, i] + self.position[a] - self.position[b] - 1.5 * self.normal[i]
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
        for i, (a, b) in enumerate(self.partners):
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
        host["a"], host["b"] = self.partners.T
        host["normal"], host["arm_a"], host["arm_b"] = self.normal, *self.arms
        host["radius"], host["give"], host["floor"] = self.radius, give, self.floor
        for k, name in enumerate(("overlap", "hardness", "wander", "layer")):
            host[name] = self.law[:, k]
        return wp.array(host, dtype=Contact, device=device)

    def solve(
        self, device: str, *, again: bool = False, kernel: wp.Kernel = probe_bodies, more: tuple[bool, ...] = ()
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Loads (n,), moves (2, bodies, 3) by the contacts, and the error told; `more` goes to the kernel."""
        model = ModelData()
        model.time_step = 1e-3
        model.medium.viscosity = device_array([1e-3 / self.scale], wp.float32, device)
        model.body.shape = device_array([0] * BODIES, wp.int32, device)
        model.body.rigid = device_array([1, 1, 0], wp.int32, device)
        model.body.translation = device_array([self.move.mobility[0, 0]], wp.float32, device)
        model.body.mobility = device_array([self.move.mobility], mat66, device)
        model.body.resistance = device_array([self.move.resistance], mat66, device)
        p = Pressed()
        p.position = device_array(self.position, wp.vec3, device)
        p.rotation = device_array(self.rotation, wp.quat, device)
        p.linear, p.angular = (device_array(v, wp.vec3, device) for v in self.free)
        p.start = device_array(self.free.reshape(-1, 3), wp.vec3, device)
        p.given, p.again, p.listed = self.contacts(device), again, empty_list(COUNT, device)
        p.load, p.error = (wp.zeros(n, dtype=float, device=device) for n in (COUNT, 1))
        wp.launch(kernel, dim=1, inputs=[model, p, *more], device=device)
        found = np.stack([m.numpy() for m in (p.linear, p.angular)]).astype(float) - self.free
        return p.load.numpy().astype(float), found, float(p.error.numpy()[0])


@HARDNESS
@AGAIN
def test_loads_obey_law_and_motion(hardness, again, device):
    """λ = λ(s⁰ + J x) and x = M Jᵀλ within what may be out of balance: float64, 12 random steps.

    With κ at a hundredth of the radius of 0.1 to 10³, the most that contacts are given.
    """
    assert pressed_contacts(PARTNERS, probe_bodies, hardness, again, device) > 40


def pressed_contacts(
    partners: np.ndarray, kernel: wp.Kernel, hardness: float, again: bool, device: str, more: tuple[bool, ...] = (),
    most: float = 0.0,
) -> int:  # fmt: skip
    """How many contacts of 12 random steps are pressed, all of which obey law and motion.

    `most`: the largest error [µm] that the solver may tell, as rounding leaves on some processors.
    """
    pressed = 0
    for seed in range(12):
        problem = Problem(seed, hardness, partners)
        load, moved, error = problem.solve(device, again=again, kernel=kernel, more=more)
        assert error <= most
        rows, mobility = problem.rows(), problem.mobility()
        motion = mobility @ rows.T @ load
        np.testing.assert_allclose(problem.turned(moved), motion, atol=MOTION)
        opening = rows @ (problem.turned(problem.free) + problem.turned(moved))
        give = np.diag(rows @ mobility @ rows.T)
        wanted = contact_law.loads(opening, problem.floor, problem.law, give)
        # the depth that a path asks for is followed to a hundredth, and its load to one and a half
        assert np.all(np.abs(load - wanted) <= 0.015 * (wanted - problem.floor) + 1e-3)
        pressed += np.sum(load > problem.floor + 1e-3)
    return pressed
