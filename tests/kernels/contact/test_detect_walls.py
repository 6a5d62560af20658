"""Contacts of rods with every shape of obstacle on the device, against float64 twins."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from otwarp.kernels.contact.obstacles import SHAPES
from otwarp.scene import Scene
from otwarp.simulation.model import Model
from tests.kernels.contact.test_detect import (
    BOX_CORNERS,
    END,
    RADIUS,
    ROUNDING,
    SIZE,
    START,
    Found,
    alone,
    ends,
    rod_body,
)
from tests.kernels.contact.test_obstacles import icosphere
from tests.kernels.samples import quaternions
from tests.reference import obstacles as twin
from tests.reference.rotations import matrix
from tests.reference.segments import along_segment, point_segment


@pytest.mark.thorough
@pytest.mark.parametrize("shape", [s for s in SHAPES if s != "mesh"])
def test_rods_touch_obstacles_where_they_are_nearest(shape, device):
    """The deepest contact has the least distance along the rod, as dense samples of the float64 twin find it."""
    n = 150
    rng = np.random.default_rng(2)
    position = rng.normal(size=(n, 1, 3)).astype(np.float32) * 1.5
    rotation = quaternions(rng, n).reshape(n, 1, 4)
    got = Found(alone(shape, size=SIZE), position, rotation, device)
    distance = functools.partial(twin.SHAPES[shape], size=np.array(SIZE))
    touching = 0
    for i in range(n):
        a, b = ends(position[i, 0], rotation[i, 0], got.reference[0])
        least, _ = along_segment(lambda p: distance(p)[0], a, b)
        overlap = RADIUS - least
        if overlap > ROUNDING:
            touching += 1
            assert got.overlap[i].max() == pytest.approx(overlap, abs=ROUNDING)
        elif overlap < -ROUNDING:
            assert got.count[i] == 0
    assert touching > 20


@pytest.mark.thorough
def test_rods_touch_meshes_where_they_are_nearest(device):
    """A polyhedron near the unit sphere: contacts lie on the segment, none deeper than the sphere says, the deepest no
    shallower than its facets allow."""
    vertices, triangles = icosphere(3)
    n, depth = 200, 0.02
    rng = np.random.default_rng(3)
    position = rng.normal(size=(n, 1, 3)).astype(np.float32)
    rotation = quaternions(rng, n).reshape(n, 1, 4)
    got = Found(alone("mesh", vertices=vertices, triangles=triangles), position, rotation, device)
    touching = 0
    for i in range(n):
        a, b = ends(position[i, 0], rotation[i, 0], got.reference[0])
        overlap = RADIUS + 1.0 - point_segment(np.zeros(3), a, b)[0]
        if overlap > depth:
            touching += 1
            assert overlap - depth < got.overlap[i].max() < overlap + ROUNDING
        elif overlap < 0.0:
            assert got.count[i] == 0
    assert touching > 50


def lying(
    shape: str, at: tuple[float, float, float], device: str, tilt: float = 0.0, **more
) -> tuple[Found, np.ndarray]:
    """Contacts of a rod along x at `at` (its middle), tilted nose down, and their places along x."""
    turn = np.array([[[0.0, np.sin(tilt / 2), 0.0, np.cos(tilt / 2)]]])
    body = rod_body("A")
    reference = Model.build(Scene(bodies=(body,)), device=device).reference[0]
    middle = matrix(turn[0, 0]) @ (0.5 * (START + END) - reference)
    position = np.array([[np.array(at) - middle]])
    got = Found(alone(shape, **more), position, turn, device, ahead=0.2)
    return got, position[0, 0, 0] + got.arm[0, : got.count[0], 0, 0]


def test_a_rod_lies_flat_on_its_ends(device):
    """On a plane, and inside the edges of a box: two contacts, equally deep."""
    for shape, top in (("plane", 0.0), ("box", 4.0)):
        got, place = lying(shape, (0.2, 0.1, top + 0.28), device, size=(9.0, 9.0, 4.0))
        assert got.count[0] == 2
        np.testing.assert_allclose(np.sort(place), [0.2 - 2.5, 0.2 + 2.5], atol=1e-5)
        np.testing.assert_allclose(got.overlap[0, :2], 0.02, atol=ROUNDING)


def test_a_rod_that_lies_over_an_edge_is_held_by_the_edge(device):
    """Its far end hangs in the air: contacts at both edges, and none beyond, also when it is tilted a little."""
    for tilt in (0.0, 0.03, -0.03):
        got, place = lying("box", (0.2, 0.1, 4.28), device, tilt=tilt, size=(1.0, 9.0, 4.0))
        assert got.count[0] == 2
        # the feet of the perpendiculars from the edges on the axis
        along = np.array([np.cos(tilt), -np.sin(tilt)])
        edges = np.array([[-1.0, 4.0], [1.0, 4.0]]) - [0.2, 4.28]
        feet = (edges @ along)[:, None] * along
        order = np.argsort(place)
        np.testing.assert_allclose(place[order], 0.2 + feet[:, 0], atol=2e-4)
        depth = RADIUS - np.linalg.norm(edges - feet, axis=1)
        assert got.overlap[0].max() == pytest.approx(depth.max(), abs=ROUNDING)
        # above the higher edge the face is a little nearer than the edge, by the square of the tilt
        np.testing.assert_allclose(got.overlap[0, order], depth, atol=0.5 * tilt**2 * 0.4 + ROUNDING)


def test_a_tilted_rod_over_an_edge_touches_at_the_edge(device):
    """Steep enough that neither end is near: one contact, with the normal across the rod."""
    got, place = lying("box", (1.0 + 0.0, 0.1, 4.25), device, tilt=0.5, size=(1.0, 9.0, 4.0))
    assert got.count[0] == 1
    np.testing.assert_allclose(got.normal[0, 0], [np.sin(0.5), 0.0, np.cos(0.5)], atol=1e-4)
    # the axis passes 0.25·cos(0.5) from the edge
    assert got.overlap[0, 0] == pytest.approx(RADIUS - 0.25 * np.cos(0.5), abs=ROUNDING)
    assert place[0] == pytest.approx(1.0 + 0.25 * np.cos(0.5) * np.sin(0.5), abs=1e-3)


def test_a_long_rod_finds_a_small_obstacle(device):
    """A ball of a tenth of the rod's radius under its middle, between all sample points there might be."""
    for x in np.linspace(-2.3, 2.3, 7):
        got, place = lying("sphere", (x, 0.0, 0.32), device, size=(0.03, 0.0, 0.0))
        assert got.count[0] >= 1
        k = int(np.argmax(got.overlap[0]))
        assert got.overlap[0, k] == pytest.approx(0.01, abs=ROUNDING)
        assert place[k] == pytest.approx(0.0, abs=1e-3)


def test_a_rod_lies_along_a_mesh_on_its_ends(device):
    """The triangles of a box: the same two contacts as on the box itself, found piece by piece."""
    got, place = lying("mesh", (0.2, 0.1, 4.28), device, vertices=BOX_CORNERS * [9.0, 9.0, 4.0])
    assert got.count[0] == 2
    np.testing.assert_allclose(np.sort(place), [0.2 - 2.5, 0.2 + 2.5], atol=1e-4)
    np.testing.assert_allclose(got.overlap[0, :2], 0.02, atol=ROUNDING)
