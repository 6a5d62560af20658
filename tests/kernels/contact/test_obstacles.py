"""Obstacles of the device against their twins: distance and normal of every shape, and moving poses."""

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.contact.obstacles import SHAPES, distance_term, moving_pose, still_pose
from otwarp.kernels.core.types import ObstacleData
from otwarp.scene import Body, Obstacle, Scene, Sphere, Track
from otwarp.simulation.model import Model
from tests.kernels.samples import evaluate, on_device, quaternions
from tests.reference import keyframes
from tests.reference import obstacles as twin
from tests.reference.rotations import matrix

ROUNDING = 2e-6
"""float32 distances up to 8 µm: a few spacings of 4.8e-7."""

BOX_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
BOX_TRIANGLES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip
SIZE = (1.5, 0.7, 2.0)
SUBDIVISIONS = 3


def icosphere(subdivisions: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices on the unit sphere and outward triangles."""
    g = (1 + np.sqrt(5)) / 2
    v = np.array([[-1, g, 0], [1, g, 0], [-1, -g, 0], [1, -g, 0], [0, -1, g], [0, 1, g], [0, -1, -g], [0, 1, -g],
                  [g, 0, -1], [g, 0, 1], [-g, 0, -1], [-g, 0, 1]])  # fmt: skip
    faces = [[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6],
             [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10],
             [8, 6, 7], [9, 8, 1]]  # fmt: skip
    points = [p / np.linalg.norm(p) for p in v]
    for _ in range(subdivisions):
        middle: dict[tuple[int, int], int] = {}
        finer = []
        for a, b, c in faces:
            ends = []
            for i, j in ((a, b), (b, c), (c, a)):
                edge = (min(i, j), max(i, j))
                if edge not in middle:
                    m = points[i] + points[j]
                    points.append(m / np.linalg.norm(m))
                    middle[edge] = len(points) - 1
                ends.append(middle[edge])
            ab, bc, ca = ends
            finer += [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
        faces = finer
    return np.array(points), np.array(faces)


def facet_depth() -> float:
    """How far the facets of the mesh lie below the unit sphere at most."""
    points, faces = icosphere(SUBDIVISIONS)
    a, b, c = (points[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    return 1.0 - float(((normal / np.linalg.norm(normal, axis=1, keepdims=True)) * a).sum(axis=1).min())


def still(shape: str, prim: str, **more) -> Obstacle:
    at, turn = Track.constant((0.0, 0.0, 0.0)), Track.constant((0.0, 0.0, 0.0, 1.0))
    return Obstacle(prim=prim, shape=shape, position=at, orientation=turn, **more)


TIMES = np.array([0.0, 0.5, 2.0])
PLACES = np.array([[0.0, 0, 0], [1.0, 2.0, -1.0], [1.0, -3.0, 0.5]])


@pytest.fixture(scope="module")
def model(device) -> Model:
    rng = np.random.default_rng(5)
    turns = quaternions(rng, 3).astype(float)
    turns *= np.sign(turns @ turns[0])[:, None]  # one hemisphere, as the reader leaves them
    ball, faces = icosphere(SUBDIVISIONS)
    obstacles = [still(name, f"/World/{name}", size=SIZE) for name in SHAPES if name != "mesh"]
    obstacles.append(still("mesh", "/World/BoxMesh", vertices=BOX_CORNERS * SIZE, triangles=BOX_TRIANGLES))
    obstacles.append(still("mesh", "/World/BallMesh", vertices=ball, triangles=faces))
    moving = Obstacle(
        prim="/World/Moving", shape="box", size=SIZE,
        position=Track(times=TIMES, values=PLACES), orientation=Track(times=TIMES, values=turns),
    )  # fmt: skip
    body = Body(prim="/World/B", position=(0.0, 0.0, 900.0), spheres=(Sphere(prim="/World/B/S", radius=1.0),))
    return Model.build(Scene(bodies=(body,), obstacles=(*obstacles, moving)), device=device)


distance_to = distance_term(tuple(SHAPES))


@wp.kernel(enable_backward=False)
def probe_distance(
    obstacles: ObstacleData,
    index: wp.array(dtype=int),
    point: wp.array(dtype=wp.vec3),
    reach: float,
    out: wp.array(dtype=wp.vec4),
):
    i = wp.tid()
    out[i] = distance_to(obstacles, index[i], point[i], reach)


@wp.kernel(enable_backward=False)
def probe_pose(
    obstacles: ObstacleData,
    index: int,
    time: wp.array(dtype=wp.float64),
    position: wp.array(dtype=wp.vec3),
    rotation: wp.array(dtype=wp.quat),
    start: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    pose = moving_pose(obstacles, index, time[i])
    position[i] = pose.position
    rotation[i] = pose.rotation
    start[i] = still_pose(obstacles, index, time[i]).position


def measure(model: Model, prim: str, points: np.ndarray, device: str, reach: float = 10.0) -> np.ndarray:
    """(n, 4) normal and distance to the obstacle at `prim`."""
    index = [o.prim for o in model.scene.obstacles].index(prim)
    given = on_device(device, (np.full(len(points), index), int), (points, wp.vec3))
    (out,) = evaluate(probe_distance, len(points), [model.data.obstacles, *given, reach], [wp.vec4], device)
    return out


@pytest.mark.parametrize("shape", [s for s in SHAPES if s != "mesh"])
def test_shapes_are_those_of_the_twins(shape, model, device):
    points = (np.random.default_rng(1).normal(size=(2000, 3)) * 2.0).astype(np.float32)
    points[:7] = [[0, 0, 0], [0, 0, 1], [0, 0, -1], [0.1, 0, 0], [3, 0, 0], [0, 3, 0], [0, 0, 3]]
    got = measure(model, f"/World/{shape}", points, device)
    expected = [twin.SHAPES[shape](p, np.array(SIZE)) for p in points.astype(float)]
    distance, normal = np.array([e[0] for e in expected]), np.array([e[1] for e in expected])
    assert (distance < 0).sum() > 50
    assert (distance > 0).sum() > 50
    assert np.abs(got[:, 3] - distance).max() < ROUNDING
    # where two faces are equally near, rounding decides between them
    same = np.abs(got[:, :3] - normal).max(axis=1) < 2e-4
    assert (~same).sum() <= 2
    np.testing.assert_allclose(np.linalg.norm(got[:, :3], axis=1), 1.0, atol=1e-6)


def test_mesh_of_a_box_is_the_box(model, device):
    rng = np.random.default_rng(2)
    points = (rng.uniform(-1.4, 1.4, size=(2000, 3)) * SIZE).astype(np.float32)
    got = measure(model, "/World/BoxMesh", points, device)
    expected = [twin.box(p, np.array(SIZE)) for p in points.astype(float)]
    distance, normal = np.array([e[0] for e in expected]), np.array([e[1] for e in expected])
    assert (distance < 0).sum() > 200
    np.testing.assert_allclose(got[:, 3], distance, atol=ROUNDING)
    clear = np.abs(distance) > 1e-3  # the direction to a surface this near is lost in rounding
    same = np.abs(got[clear, :3] - normal[clear]).max(axis=1) < 2e-3
    assert (~same).sum() <= 4


def test_mesh_of_a_sphere_is_nearly_the_sphere(model, device):
    rng = np.random.default_rng(3)
    way = rng.normal(size=(1000, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    points = way * rng.uniform(0.7, 2.0, size=(1000, 1))
    got = measure(model, "/World/BallMesh", points.astype(np.float32), device)
    excess = got[:, 3] - (np.linalg.norm(points, axis=1) - 1.0)
    # the polyhedron lies inside the sphere, so distances to it are larger
    assert excess.min() > -ROUNDING
    assert excess.max() < facet_depth() + ROUNDING < 0.02
    assert np.arccos(np.clip((got[:, :3] * way).sum(axis=1), -1, 1)).max() < 0.2


def test_an_open_mesh_is_a_sheet_of_two_sides(device):
    """One face of the box: distances are positive on both sides, normals point away from it."""
    sheet = still("mesh", "/World/Sheet", vertices=BOX_CORNERS, triangles=BOX_TRIANGLES[:2])  # at x = −1
    body = Body(prim="/World/B", spheres=(Sphere(prim="/World/B/S", radius=1.0),))
    model = Model.build(Scene(bodies=(body,), obstacles=(sheet,)), device=device)
    points = np.array([[-1.5, 0.3, 0.2], [-0.5, 0.3, 0.2], [-1.0, 0.3, 1.75]], dtype=np.float32)
    got = measure(model, "/World/Sheet", points, device)
    np.testing.assert_allclose(got[:, 3], [0.5, 0.5, 0.75], atol=ROUNDING)
    np.testing.assert_allclose(got[:, :3], [[-1, 0, 0], [1, 0, 0], [0, 0, 1]], atol=ROUNDING)


def test_mesh_search_ends_at_its_reach(model, device):
    points = np.array([[0.0, 0.0, 3.0]], dtype=np.float32)
    assert measure(model, "/World/BallMesh", points, device, reach=2.1)[0, 3] == pytest.approx(2.0, abs=0.02)
    assert measure(model, "/World/BallMesh", points, device, reach=1.5)[0, 3] > 1e6


def test_moving_poses_follow_their_key_frames(model, device):
    rng = np.random.default_rng(4)
    time = np.concatenate([[-1.0, 0.0, 0.5, 2.0, 3.0], rng.uniform(-0.2, 2.2, 200)])
    index, turns = len(model.scene.obstacles) - 1, model.scene.obstacles[-1].orientation.values
    inputs = [model.data.obstacles, index, *on_device(device, (time, wp.float64))]
    position, rotation, start = evaluate(probe_pose, len(time), inputs, [wp.vec3, wp.quat, wp.vec3], device)
    np.testing.assert_array_equal(start, np.broadcast_to(PLACES[0], start.shape))
    for t, p, q in zip(time, position, rotation, strict=True):
        np.testing.assert_allclose(p, keyframes.interpolate(TIMES, PLACES, t), atol=ROUNDING)
        expected = keyframes.interpolate_rotation(TIMES, turns, t)
        np.testing.assert_allclose(matrix(q), matrix(expected), atol=4 * ROUNDING)
