"""Starting overlaps: the grid finds every touching pair, and distances agree with sampled surfaces."""

from __future__ import annotations

import dataclasses
import time

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.scene import Body, Obstacle, Rod, Sphere, Track
from otwarp.scene.check.overlap import _beads, candidate_pairs, check_overlaps, mesh_distance, signed_distance
from otwarp.scene.transforms import rotation_matrix

TURN = np.array([0.1, -0.2, 0.3, np.sqrt(1 - 0.14)])


def touching(centres: np.ndarray, radii: np.ndarray, a: np.ndarray, b: np.ndarray) -> set[tuple[int, int]]:
    near = np.linalg.norm(centres[a] - centres[b], axis=1) < radii[a] + radii[b]
    pairs = [(min(i, j), max(i, j)) for i, j in zip(a[near].tolist(), b[near].tolist(), strict=True)]
    assert len(pairs) == len(set(pairs))
    return set(pairs)


@pytest.mark.parametrize("sizes", [(1.0, 1.0), (0.5, 2.0), (0.2, 30.0)])
@pytest.mark.parametrize("spread", [(20.0, 20.0, 20.0), (60.0, 60.0, 0.0), (200.0, 0.0, 0.0)])
def test_candidates_hold_every_touching_pair_once(sizes: tuple[float, float], spread: tuple[float, ...]) -> None:
    random = np.random.default_rng(5)
    centres = random.random((300, 3)) * np.array(spread) - 7.0
    radii = np.where(random.random(300) < 0.05, sizes[1], sizes[0])
    expected = touching(centres, radii, *np.triu_indices(300, 1))
    assert len(expected) > 10
    assert touching(centres, radii, *candidate_pairs(centres, radii)) == expected


def test_ten_thousand_cells_cost_in_proportion() -> None:
    """Ten times the cells cost about ten times as much; trying all pairs would cost a hundred times as much."""
    n = 10_000
    grid = np.stack(np.meshgrid(np.arange(100.0), np.arange(100.0), [0.0]), axis=-1).reshape(-1, 3) * 6.1
    sphere = (Sphere(prim="/C", radius=3.0),)
    cells = [
        Body(prim="/C", instance=i, position=tuple(p), spheres=sphere, kind="cell") for i, p in enumerate(grid.tolist())
    ]

    def cost(count: int) -> float:
        times = []
        for _ in range(3):
            begin = time.process_time()
            check_overlaps("scene", cells[:count], [])
            times.append(time.process_time() - begin)
        return min(times)

    assert cost(n) < 40.0 * cost(n // 10)
    cells[n - 1] = dataclasses.replace(cells[n - 1], position=tuple(grid[17] + [0.0, 0.0, 1.0]))
    with pytest.raises(InputError, match=r"/C\[17\]: overlap with /C\[9999\] = 5 µm: must be at most 0.3 µm"):
        check_overlaps("scene", cells, [])


def test_only_colliding_spheres_of_different_bodies_count() -> None:
    a = Body(prim="/A", spheres=(Sphere(prim="/A/1", radius=1.0), Sphere(prim="/A/2", radius=1.0, offset=(0.5, 0, 0))))
    b = Body(prim="/B", spheres=(Sphere(prim="/B/1", radius=1.0, collides=False),))
    check_overlaps("scene", [a, b], [])
    solid = dataclasses.replace(b, spheres=(Sphere(prim="/B/1", radius=1.0),))
    with pytest.raises(InputError, match="/A: overlap with /B"):
        check_overlaps("scene", [a, solid], [])


def test_offsets_turn_with_the_body() -> None:
    half = float(np.sqrt(0.5))
    arm = (Sphere(prim="/A/1", radius=1.0, offset=(10.0, 0.0, 0.0)),)
    turned = Body(prim="/A", orientation=(0.0, 0.0, half, half), spheres=arm)
    bead = Body(prim="/B", position=(0.0, 10.0, 0.0), spheres=(Sphere(prim="/B/1", radius=1.0),))
    check_overlaps("scene", [dataclasses.replace(turned, orientation=(0.0, 0.0, 0.0, 1.0)), bead], [])
    with pytest.raises(InputError, match="/A: overlap with /B = 2 µm"):
        check_overlaps("scene", [turned, bead], [])


def test_a_tenth_of_the_smaller_radius_is_allowed() -> None:
    bead = Body(prim="/A", spheres=(Sphere(prim="/A/1", radius=1.0),))
    for gap, allowed in ((-0.099, True), (-0.101, False)):
        other = Body(prim="/B", position=(3.0 + gap, 0, 0), spheres=(Sphere(prim="/B/1", radius=2.0),))
        wall = Obstacle(
            prim="/W",
            shape="plane",
            position=Track.constant((0.0, 0.0, -1.0 - gap)),
            orientation=Track.constant((0.0, 0.0, 0.0, 1.0)),
        )
        for bodies, obstacles in (([bead, other], []), ([bead], [wall])):
            if allowed:
                check_overlaps("scene", bodies, obstacles)
            else:
                with pytest.raises(InputError, match=r"0\.101 µm: must be at most 0.1 µm at the start"):
                    check_overlaps("scene", bodies, obstacles)


def surface(shape: str, size: tuple[float, float, float], n: int) -> np.ndarray:
    """Points spread over the surface of a shape, made without its distance function."""
    random = np.random.default_rng(3)
    if shape == "box":
        points = random.uniform(-1, 1, (n, 3))
        face = random.integers(0, 3, n)
        points[np.arange(n), face] = np.sign(points[np.arange(n), face])
        return points * size
    angle, radius, half = random.uniform(0, 2 * np.pi, n), size[0], size[1]
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if shape == "cylinder":
        side = np.column_stack([radius * ring, random.uniform(-half, half, n)])
        cap = np.column_stack(
            [radius * ring * np.sqrt(random.random((n, 1))), half * np.sign(random.uniform(-1, 1, n))]
        )
        return np.concatenate([side, cap])
    ball = random.normal(size=(n, 3))
    ball *= radius / np.linalg.norm(ball, axis=1, keepdims=True)
    if shape == "sphere":
        return ball
    return np.concatenate(
        [np.column_stack([radius * ring, random.uniform(-half, half, n)]), ball + np.sign(ball) * [0, 0, half]]
    )


@pytest.mark.parametrize(
    ("shape", "size"),
    [
        ("box", (1.0, 2.0, 0.5)),
        ("sphere", (1.3, 0.0, 0.0)),
        ("cylinder", (1.0, 0.7, 0.0)),
        ("capsule", (0.6, 1.1, 0.0)),
    ],
)
def test_distance_agrees_with_a_sampled_surface(shape, size) -> None:
    from scipy.spatial import cKDTree

    resolution = 0.02  # µm: spacing of the 2e5 or 4e5 samples on surfaces of some 10 µm², with room
    place = np.array([3.0, -2.0, 1.0])
    obstacle = Obstacle(
        prim="/O", shape=shape, position=Track.constant(place), orientation=Track.constant(TURN), size=size
    )
    matrix = rotation_matrix(TURN)
    samples = cKDTree(surface(shape, size, 200_000) @ matrix.T + place)
    points = np.random.default_rng(4).uniform(-2.5, 2.5, (400, 3)) + place
    distance = signed_distance(obstacle, points)
    assert np.abs(np.abs(distance) - samples.query(points)[0]).max() < resolution
    assert signed_distance(obstacle, place[None])[0] < 0.0
    assert np.any(distance > 0.0)


def block(place: tuple[float, float, float], half: float = 5.0, *, inward: bool = False) -> Obstacle:
    """A cube as a mesh: outward faces, every face with vertices of its own, as programs write flat shading."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float) * half
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.arange(24).reshape(6, 4)[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    return Obstacle(
        prim="/M",
        shape="mesh",
        position=Track.constant(place),
        orientation=Track.constant(TURN),
        vertices=corners[np.array(faces).ravel()],
        triangles=triangles[:, ::-1] if inward else triangles,
    )


def test_a_mesh_is_as_far_as_the_box_it_draws() -> None:
    box = dataclasses.replace(block((1.0, 2.0, 3.0)), shape="box", size=(5.0, 5.0, 5.0))
    points = np.random.default_rng(2).uniform(-12.0, 12.0, (400, 3)) + np.array([1.0, 2.0, 3.0])
    exact = signed_distance(box, points)
    found = mesh_distance(block((1.0, 2.0, 3.0)), points, np.full(400, 2.0))
    assert found == pytest.approx(np.where(exact > 2.0, np.inf, np.maximum(exact, -2.0)), abs=1e-12)
    assert (exact < -2.0).any() and (np.abs(exact) < 2.0).any()


@pytest.mark.parametrize(
    ("place", "words"),
    [((0.0, 0.0, 0.0), "2 µm"), ((4.0, 0.0, 0.0), "2 µm"), ((5.5, 0.0, 0.0), "0.5 µm"), ((6.0, 0.0, 0.0), None)],
    ids=["deep inside", "inside", "through the surface", "outside"],
)
def test_a_bead_in_a_mesh_is_refused(place: tuple[float, float, float], words: str | None) -> None:
    bead = Body(prim="/A", position=tuple(rotation_matrix(TURN) @ place), spheres=(Sphere(prim="/A/1", radius=1.0),))
    if words is None:
        check_overlaps("scene", [bead], [block((0.0, 0.0, 0.0))])
        return
    with pytest.raises(InputError, match=f"/A: overlap with /M = {words}"):
        check_overlaps("scene", [bead], [block((0.0, 0.0, 0.0))])


def test_a_mesh_that_faces_inwards_or_is_open_has_room_inside() -> None:
    bead = Body(prim="/A", spheres=(Sphere(prim="/A/1", radius=1.0),))
    check_overlaps("scene", [bead], [block((0.0, 0.0, 0.0), inward=True)])
    whole = block((0.0, 0.0, 0.0))
    check_overlaps("scene", [bead], [dataclasses.replace(whole, triangles=whole.triangles[1:])])
    touching_face = dataclasses.replace(bead, position=tuple(rotation_matrix(TURN) @ (4.5, 0.0, 0.0)))
    with pytest.raises(InputError, match=r"overlap with /M = 0\.5 µm"):
        check_overlaps("scene", [touching_face], [block((0.0, 0.0, 0.0), inward=True)])


@pytest.mark.parametrize("radius", [1e-9, 5e-315])
def test_a_rod_as_thin_as_nothing_takes_no_memory(radius):
    """Found by the long fuzz: the number of spheres that stand for it overflowed."""
    rod = Rod(prim="/World/B/R", start=(0.0, 0.0, 0.0), end=(1.0, 0.0, 0.0), radius=radius)
    assert len(_beads(rod)) < 20_000
