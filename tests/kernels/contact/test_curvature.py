"""Relative curvature of a sphere and the obstacle that it touches, and how its path along the obstacle bends."""

from __future__ import annotations

import numpy as np
import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.curvature import beside_rod, path_bend_term, relative_radius_term
from otwarp.kernels.contact.obstacles import SHAPES
from otwarp.kernels.core.types import ObstacleData
from otwarp.simulation.packing.arrays import device_array
from tests.kernels.contact.test_excursion import ROUNDING
from tests.kernels.samples import evaluate, on_device

_radius_of = relative_radius_term(tuple(SHAPES))


_flat = relative_radius_term(("plane", "box", "mesh"))


@wp.kernel(enable_backward=False)
def probe_radius(
    obstacles: ObstacleData, o: wp.array(dtype=int), point: wp.array(dtype=wp.vec3), out: wp.array(dtype=wp.vec2)
):
    i = wp.tid()
    key = obstacles.shape[o[i]]
    outward = wp.vec3(0.0, 0.0, 1.0)
    if wp.abs(point[i][2]) <= obstacles.size[o[i]][1] and key != wp.static(SHAPES["plane"][0]):
        outward = wp.vec3(1.0, 0.0, 0.0)
    out[i] = wp.vec2(
        _radius_of(obstacles, o[i], point[i], outward, 1.5), _flat(obstacles, o[i], point[i], outward, 1.5)
    )


def test_curvatures_add(device):
    """A sphere of 1.5 µm on obstacles of 0.5 µm: R = 1/√(AB); flat ends and flat shapes leave it its own radius."""
    obstacles = ObstacleData()
    obstacles.shape = device_array([key for key, _ in SHAPES.values()], wp.int32, device)
    sizes = {"sphere": (0.5, 0.0, 0.0), "cylinder": (0.5, 2.0, 0.0), "capsule": (0.5, 2.0, 0.0), "box": (1.0, 1.0, 1.0)}
    obstacles.size = device_array([sizes.get(shape, (0.0, 0.0, 0.0)) for shape in SHAPES], wp.vec3, device)
    order = list(SHAPES)
    ball, side = 1.0 / (1 / 1.5 + 1 / 0.5), 1.0 / np.sqrt((1 / 1.5) * (1 / 1.5 + 1 / 0.5))
    cases = [
        ("sphere", (0.0, 1.2, 1.6), ball),
        ("capsule", (2.0, 0.0, -1.9), side),
        ("capsule", (0.5, 0.0, 2.1), ball),
        ("cylinder", (2.0, 0.0, 1.9), side),
        ("cylinder", (0.2, 0.0, 3.4), 1.5),
        ("plane", (0.0, 0.0, 1.4), 1.5),
        ("box", (0.0, 0.0, 2.4), 1.5),
        ("mesh", (0.0, 0.0, 1.4), 1.5),
    ]
    given = on_device(
        device,
        ([order.index(c[0]) for c in cases], int),
        ([c[1] for c in cases], wp.vec3),  # type: ignore[arg-type]
    )
    (got,) = evaluate(probe_radius, len(cases), [obstacles, *given], [wp.vec2], device)
    np.testing.assert_allclose(got[:, 0], [c[2] for c in cases], rtol=ROUNDING)
    np.testing.assert_array_equal(got[:, 1], np.float32(1.5))


_bend_of = path_bend_term(tuple(SHAPES))


@wp.kernel(enable_backward=False)
def probe_bend(
    obstacles: ObstacleData, o: wp.array(dtype=int), point: wp.array(dtype=wp.vec3), outward: wp.array(dtype=wp.vec3),
    out: wp.array(dtype=wp.vec4),
):  # fmt: skip
    i = wp.tid()
    out[i] = _bend_of(obstacles, o[i], point[i], outward[i], 1.5)


def test_paths_bend_about_centres_axes_edges_and_corners(device):
    """Ridge and curvature of where the centre of a touching sphere of 1.5 µm goes."""
    obstacles = ObstacleData()
    obstacles.shape = device_array([key for key, _ in SHAPES.values()], wp.int32, device)
    sizes = {"sphere": (0.5, 0.0, 0.0), "cylinder": (0.5, 2.0, 0.0), "capsule": (0.5, 2.0, 0.0), "box": (1.0, 1.0, 1.0)}
    obstacles.size = device_array([sizes.get(shape, (0.0, 0.0, 0.0)) for shape in SHAPES], wp.vec3, device)
    x, z, edge, corner = (1, 0, 0), (0, 0, 1), (0.6, 0, 0.8), (0.36, 0.48, 0.8)
    cases = [
        ("plane", (0, 0, 1.5), z, (0, 0, 0, 0)),
        ("mesh", (0, 0, 1.5), z, (0, 0, 0, 0)),
        ("sphere", (2, 0, 0), x, (0, 0, 0, 0.5)),
        ("capsule", (0, 0, 4), z, (0, 0, 0, 0.5)),
        ("capsule", (2, 0, 1), x, (0, 0, 1, 0.5)),
        ("cylinder", (2, 0, 1), x, (0, 0, 1, 0.5)),
        ("cylinder", (0, 0, 3.5), z, (0, 0, 0, 0)),
        ("cylinder", (1.4, 0, 3.2), edge, (0, 1, 0, 1 / 1.5)),
        ("box", (2.5, 0, 0), x, (0, 0, 0, 0)),
        ("box", (1.9, 0, 2.2), edge, (0, 1, 0, 1 / 1.5)),
        ("box", (1.54, 1.72, 2.2), corner, (0, 0, 0, 1 / 1.5)),
    ]
    order = list(SHAPES)
    given = on_device(
        device,
        ([order.index(c[0]) for c in cases], int),
        *(([tuple(map(float, c[k])) for c in cases], wp.vec3) for k in (1, 2)),
    )
    (got,) = evaluate(probe_bend, len(cases), [obstacles, *given], [wp.vec4], device)
    np.testing.assert_allclose(got, np.array([c[3] for c in cases], dtype=float), atol=ROUNDING)


@wp.kernel(enable_backward=False)
def probe_rod(half: wp.array(dtype=wp.vec3), ridge: wp.array(dtype=wp.vec3), out: wp.array(dtype=wp.vec4)):
    i = wp.tid()
    c = Contact()
    c.normal = wp.vec3(0.0, 0.0, 1.0)
    c.curvature = 2.0
    c.ridge = ridge[i]
    c = beside_rod(c, half[i])
    out[i] = wp.vec4(c.ridge[0], c.ridge[1], c.ridge[2], c.curvature)


def test_rods_are_flat_along_their_axes(device):
    """Of its side, not of its end; of two sides that cross, everywhere; a sphere changes nothing."""
    cases = [
        ((3, 0, 0), (0, 0, 0), (1, 0, 0, 2)),
        ((0, 0, 3), (0, 0, 0), (0, 0, 0, 2)),
        ((3, 0, 0), (1, 0, 0), (1, 0, 0, 2)),
        ((3, 0, 0), (0, 1, 0), (0, 1, 0, 0)),
        ((0, 0, 0), (0, 1, 0), (0, 1, 0, 2)),
    ]
    rows = on_device(device, *(([tuple(map(float, c[k])) for c in cases], wp.vec3) for k in (0, 1)))
    (got,) = evaluate(probe_rod, len(cases), rows, [wp.vec4], device)
    np.testing.assert_allclose(got, np.array([c[2] for c in cases], dtype=float), atol=ROUNDING)
