"""Contacts of rods on the device against float64 twins: with rods, spheres and every shape of obstacle."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.contact_list import ContactList
from otwarp.kernels.contact.detect import pair_contacts_term, pair_reach_term
from otwarp.kernels.contact.detect_walls import wall_contacts_term, wall_poses_term, wall_reach_term
from otwarp.kernels.contact.obstacles import SHAPES
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import ModelData, Move, Pose, ReadoutData, vec6
from otwarp.scene import Body, Obstacle, Rod, Scene, Sphere, Track
from otwarp.simulation.model import Model
from otwarp.simulation.packing.arrays import device_array
from otwarp.simulation.state import Readout
from tests.kernels.samples import quaternions
from tests.reference.rotations import matrix
from tests.reference.segments import point_segment, segment_segment

ROUNDING = 5e-6
"""Overlaps from float32 coordinates of up to 10 µm (spacing 1e-6), with the rotation of an arm in between."""

START, END, RADIUS = np.array([-2.0, 0.0, 0.5]), np.array([3.0, 0.0, 0.5]), 0.3
"""The rod of both bodies, in their frames."""

BALL = 0.7
"""Radius of the sphere of both bodies, at their origins."""

SIZE = (1.5, 0.7, 2.0)
ROOM = 16


def rod_body(name: str, **more) -> Body:
    ball = Sphere(prim=f"/World/{name}/S", radius=BALL, collides=False)
    rod = Rod(prim=f"/World/{name}/R", start=tuple(START), end=tuple(END), radius=RADIUS)
    return Body(prim=f"/World/{name}", spheres=(ball,), rods=(rod,), **more)


AWAY = (0.0, 0.0, 900.0)
"""Where a body may start; what is looked at are poses that tests give."""


def sphere_body(name: str) -> Body:
    return Body(prim=f"/World/{name}", spheres=(Sphere(prim=f"/World/{name}/S", radius=BALL),))


BOX_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
BOX_FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


def still(shape: str, at: tuple[float, float, float] = (0.0, 0.0, 0.0), **more) -> Obstacle:
    if shape == "mesh":
        more = {"vertices": BOX_CORNERS, "triangles": BOX_FACES} | more
    place, turn = Track.constant(at), Track.constant((0.0, 0.0, 0.0, 1.0))
    return Obstacle(prim=f"/World/{shape}", shape=shape, position=place, orientation=turn, **more)


def alone(shape: str, **more) -> Scene:
    """A rod and one obstacle at the origin; one of every other shape far below, so that all tests share a kernel."""
    others = [still(other, (0.0, 0.0, -900.0), size=SIZE) for other in SHAPES if other != shape]
    return Scene(bodies=(rod_body("A", position=AWAY),), obstacles=(still(shape, **more), *others))


@functools.lru_cache(maxsize=8)
def probe(features: Features, obstacle: bool) -> wp.Kernel:
    """Kernel that lists the contacts of a pair of bodies, or of body 0 with the obstacles, for poses as given."""
    features = dataclasses.replace(features, max_contacts=ROOM, body_space=False, phased=False, team=1)
    both = (pair_reach_term, pair_contacts_term)
    its = (wall_reach_term, wall_contacts_term, wall_poses_term)
    pair_reach, pairs = (None, None) if obstacle else (term(features) for term in both)
    wall_reach, walls, poses = (term(features) for term in its) if obstacle else (None, None, None)

    @wp.kernel(module="unique", enable_backward=False)
    def list_contacts(
        model: ModelData,
        readout: ReadoutData,
        position: wp.array2d(dtype=wp.vec3),
        rotation: wp.array2d(dtype=wp.quat),
        ahead: float,
        count: wp.array(dtype=int),
        found: wp.array2d(dtype=wp.vec4),
        arms: wp.array3d(dtype=wp.vec3),
    ):
        i = wp.tid()
        contacts = wp.zeros(shape=(ROOM,), dtype=Contact)
        pair = wp.zeros(shape=(1,), dtype=wp.vec2i)
        four = wp.zeros(shape=(1,), dtype=wp.vec4)
        three = wp.zeros(shape=(1,), dtype=wp.vec3)
        two = wp.zeros(shape=(1,), dtype=wp.vec2)
        one = wp.zeros(shape=(1,), dtype=float)
        six = wp.zeros(shape=(1,), dtype=vec6)
        listed = ContactList(contacts, pair, four, four, two, one, four, four, three, three)
        first = Pose(position[i, 0], rotation[i, 0])
        rest = Move(wp.vec3(0.0), wp.vec3(0.0))
        n = wp.int32(0)
        if wp.static(obstacle):
            for o in range(model.obstacles.shape.shape[0]):
                wall, later = poses(model, o, wp.float64(0.0))
                reach = wall_reach(model, 0, o, first, wall, later, 0.0, ahead)
                if reach >= 0.0:
                    n = walls(
                        model, readout, 0, 0, o, first, rest, wall, later, reach, six, six, listed, n, wp.int64(0)
                    )
        else:
            second = Pose(position[i, 1], rotation[i, 1])
            reach = pair_reach(model, 0, 1, first, second, 0.0, ahead)
            if reach >= 0.0:
                n = pairs(model, readout, 0, 0, 1, first, second, rest, rest, reach, six, six, listed, 0, wp.int64(0))
        count[i] = n
        for k in range(n):
            c = contacts[k]
            found[i, k] = wp.vec4(c.normal[0], c.normal[1], c.normal[2], c.overlap)
            arms[i, k, 0] = c.arm_a
            arms[i, k, 1] = c.arm_b

    return list_contacts


class Found:
    """Contacts of n arrangements.

    Attributes:
        count: (n,) contacts.
        normal: (n, ROOM, 3).
        overlap: (n, ROOM) [µm], −inf where there is none.
        arm: (n, ROOM, 2, 3) [µm].
    """

    def __init__(self, scene: Scene, position: np.ndarray, rotation: np.ndarray, device: str, ahead: float = 0.0):
        model = Model.build(scene, device=device)
        assert model.features.rods
        n = len(position)
        self.count = wp.zeros(n, dtype=int, device=device)
        found, arms = (
            wp.zeros((n, ROOM), dtype=wp.vec4, device=device),
            wp.zeros((n, ROOM, 2), dtype=wp.vec3, device=device),
        )
        readout = Readout.empty(model)
        inputs = [
            model.data,
            readout.data(),
            device_array(position, wp.vec3, device, ndim=2),
            device_array(rotation, wp.quat, device, ndim=2),
            ahead,
        ]
        kernel = probe(model.features, bool(scene.obstacles))
        wp.launch(kernel, dim=n, inputs=inputs, outputs=[self.count, found, arms], device=device)
        self.count = self.count.numpy()
        self.normal = found.numpy()[..., :3].astype(float)
        listed = np.arange(ROOM) < self.count[:, None]
        self.overlap = np.where(listed, found.numpy()[..., 3].astype(float), -np.inf)
        self.arm = arms.numpy().astype(float)
        self.reference = model.reference


def ends(position: np.ndarray, rotation: np.ndarray, reference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ends of a body's rod in the world, its reference point being at `position`."""
    turn = matrix(rotation.astype(float))
    return position + turn @ (START - reference), position + turn @ (END - reference)


def poses(seed: int, n: int, spread: float) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2, 3) positions and (n, 2, 4) rotations of two bodies that are near each other, far from the origin."""
    rng = np.random.default_rng(seed)
    position = np.array([4.0, -3.0, 2.0]) + rng.uniform(-spread, spread, (n, 2, 3))
    return position.astype(np.float32), quaternions(rng, 2 * n).reshape(n, 2, 4)


@pytest.mark.thorough
def test_rods_touch_where_they_are_nearest(device):
    """The deepest contact is that of the nearest points of the axes, listed if within reach; the arms meet there."""
    bodies, n, ahead = (rod_body("A"), rod_body("B", position=AWAY)), 1500, 0.2
    position, rotation = poses(0, n, 1.0)
    got = Found(Scene(bodies=bodies), position, rotation, device, ahead)
    touching = 0
    for i in range(n):
        (a0, a1), (b0, b1) = (ends(position[i, k], rotation[i, k], got.reference[k]) for k in (0, 1))
        overlap = 2 * RADIUS - segment_segment(a0, a1, b0, b1)
        if overlap < -ahead - ROUNDING:
            assert got.count[i] == 0
            continue
        if overlap < -ahead + ROUNDING:
            continue
        touching += 1
        assert got.overlap[i].max() == pytest.approx(overlap, abs=ROUNDING)
        for k in range(got.count[i]):
            point, near = (position[i, j] + got.arm[i, k, j] for j in (0, 1))
            assert point_segment(point, a0, a1)[0] < ROUNDING
            distance, s = point_segment(point, b0, b1)
            np.testing.assert_allclose(near, b0 + s * (b1 - b0), atol=1e-4)
            np.testing.assert_allclose(got.normal[i, k] * distance, point - near, atol=ROUNDING)
    assert touching > 200


def test_a_rod_and_a_sphere_touch_once(device):
    """In either order of the bodies; along the side, and at the rounded ends."""
    for order in ((0, 1), (1, 0)):
        bodies = tuple((rod_body("R"), sphere_body("S"))[k] for k in order)
        position, rotation = poses(1, 400, 2.0)
        got = Found(Scene(bodies=bodies), position, rotation, device)
        rod, ball = order.index(0), order.index(1)
        inside = 0
        for i in range(len(position)):
            a, b = ends(position[i, rod], rotation[i, rod], got.reference[rod])
            distance, s = point_segment(position[i, ball].astype(float), a, b)
            overlap = RADIUS + BALL - distance
            if abs(overlap) > ROUNDING:
                assert got.count[i] == (overlap > 0.0)
            if overlap > ROUNDING:
                assert got.overlap[i, 0] == pytest.approx(overlap, abs=ROUNDING)
                inside += 0.0 < s < 1.0
        assert inside > 30


def test_parallel_rods_touch_at_both_ends_of_where_they_meet(device):
    """Shifted along each other: contacts at the ends of the common part, whichever body they belong to; a tilt of less
    than the valley's slope leaves both, a larger one the deeper."""
    bodies = (rod_body("A"), rod_body("B", position=AWAY))
    length, gap = float(END[0] - START[0]), 0.55
    shifts = np.array([0.0, 1.0, -1.7, 3.0, 4.9])
    position = np.zeros((len(shifts), 2, 3))
    position[:, 1, 0], position[:, 1, 2] = shifts, gap
    rotation = np.tile([0.0, 0.0, 0.0, 1.0], (len(shifts), 2, 1))
    got = Found(Scene(bodies=bodies), position, rotation, device)
    for i, shift in enumerate(shifts):
        common = length - abs(shift)
        assert got.count[i] == (2 if common > 0.5 * RADIUS else 1)
        np.testing.assert_allclose(got.overlap[i, : got.count[i]], 2 * RADIUS - gap, atol=ROUNDING)
        if got.count[i] == 2:
            assert np.ptp(got.arm[i, :2, 0, 0]) == pytest.approx(common, abs=1e-4)
    # turned by 0.05 and 0.2 about the middle of the lower rod's end, so that one end of the upper comes nearer
    for tilt, contacts in ((0.05, 2), (0.2, 1)):
        turned = np.array([[[0, 0, 0, 1.0], [0, np.sin(tilt / 2), 0, np.cos(tilt / 2)]]])
        at = np.array([[[0, 0, 0], [0, 0, gap]]], dtype=float)
        high = Found(Scene(bodies=bodies), at, turned, device, ahead=1.0)
        assert high.count[0] == contacts
        (a0, a1), (b0, b1) = (ends(at[0, k], turned[0, k], high.reference[k]) for k in (0, 1))
        assert high.overlap[0].max() == pytest.approx(2 * RADIUS - segment_segment(a0, a1, b0, b1), abs=ROUNDING)
