"""A scene → what the page draws of it, in the colours and shapes of its stage; and the triangles of the solids in it.

Triangles are vertices (n, 3) and faces (m, 3), counter-clockwise seen from outside.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from otwarp.scene import Body, Obstacle, Scene, Trap
from otwarp.scene.drawing.draw_list import BOX, CAPSULE, MESH, PLANE, SPHERE, TUBE, TriangleMesh, View
from otwarp.scene.obstacle_shapes import SHAPES
from otwarp.scene.transforms import align_z, rotate, rotation_matrix
from otwarp.teleop import vec3
from otwarp.teleop.page.protocol import (
    BallGroup,
    BodyDrawing,
    CameraDrawing,
    Colour,
    Drawing,
    MeshPart,
    MovingDrawing,
    TrapDrawing,
)

if TYPE_CHECKING:
    from otwarp.scene.drawing.parts import Drawn

CENTRED = 1e-9
"""Offset of a ball from its body's origin below which its rotation cannot be seen [µm]."""
NARROW = 0.9
"""Width over height of the picture between the page's two panels on a common screen."""
SMALL = 0.7
"""Size over that of the largest solid beside it below which a ball gets fewer faces."""
ROBOT, CELL, THING = (0.90, 0.27, 0.04), (0.92, 0.20, 0.36), (0.24, 0.34, 0.55)
"""Linear colours of bodies and obstacles for a scene without a stage."""
LIGHT = {"left": (1.0, 0.1, 0.07), "right": (0.03, 0.75, 1.0), "none": (0.15, 1.0, 0.35)}
"""Linear colours of traps, by hand, for one that its stage does not draw."""
Triangles = tuple[np.ndarray, np.ndarray]
SIDES = 32
"""Flat sides of a round solid."""
FARTHEST_PLANE = 300.0
"""Half side at which an unbounded plane is cut off [µm]."""
BEAM_LENGTH, BEAM_WAIST, BEAM_RADIUS = 10.0, 0.22, 2.1
"""Half length, radius at the focus and at the ends of a drawn beam [µm]: a symbol, as in the scenes."""


def compose(scene: Scene) -> Drawing:
    """What the page draws of a scene; from its stage where there is one, else from the description alone."""
    by_owner, view = _from_stage(scene) if scene.file is not None and scene.file.is_file() else _from_description(scene)
    single = [i for i, body in enumerate(scene.bodies) if _is_ball(body)]
    apart = [i for i in range(len(scene.bodies)) if i not in set(single)]
    still = [o for o in scene.obstacles if not (o.position.animated or o.orientation.animated)]
    moving = [o for o in scene.obstacles if o.position.animated or o.orientation.animated]
    fixed = [d for owner in ("", *(o.prim for o in still)) for d in by_owner.get(owner, ())]
    return Drawing(
        title=scene.file.stem.replace("_", " ") if scene.file else "scene",
        names=tuple(_short(body) for body in scene.bodies),
        robots=np.array([body.kind == "robot" for body in scene.bodies], dtype=bool),
        warning_force=np.array([body.warning_force for body in scene.bodies], dtype=float),
        touching=_touching(scene.bodies),
        bodies=tuple(
            BodyDrawing(index=i, parts=_parts(by_owner.get(scene.bodies[i].prim, ()), _pose(scene.bodies[i])))
            for i in apart
        ),
        balls=_balls(scene, single, by_owner),
        fixed=_parts(fixed, np.eye(4)),
        moving=tuple(
            MovingDrawing(
                parts=_parts(by_owner.get(o.prim, ()), _matrix(o.position.at(0.0), o.orientation.at(0.0))),
                times=(o.position.times, o.orientation.times),
                position=o.position.values,
                orientation=o.orientation.values,
            )
            for o in moving
        ),
        traps=tuple(_trap(scene, trap, by_owner.get(trap.prim, ())) for trap in scene.traps),
        position=np.array([b.position for b in scene.bodies]).reshape(-1, 3),
        orientation=np.array([b.orientation for b in scene.bodies]).reshape(-1, 4),
        distance_warning=scene.goal.distance_warning if scene.goal else math.inf,
        camera=_camera(view),
    )


def display(linear: Sequence[float] | np.ndarray) -> Colour:
    """Linear RGB from 0 to 1 → sRGB from 0 to 255 (IEC 61966-2-1)."""
    x = np.clip(np.asarray(linear, dtype=float), 0.0, 1.0)
    y = np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.power(np.maximum(x, 1e-12), 1.0 / 2.4) - 0.055)
    r, g, b = (round(255.0 * float(c)) for c in y)
    return r, g, b


def _from_stage(scene: Scene) -> tuple[dict[str, list[Drawn]], View]:
    from otwarp.scene.drawing.parts import read_drawn

    assert scene.file is not None
    traps = [trap.prim for trap in scene.traps]
    owners = {*traps, *(b.prim for b in scene.bodies), *(o.prim for o in scene.obstacles)}
    return read_drawn(scene.file, owners, traps, scene.overrides)


def _from_description(scene: Scene) -> tuple[dict[str, list[Drawn]], View]:
    """Spheres, rods and obstacles as they are described, seen from a place where all bodies are in view."""
    from otwarp.scene.drawing.parts import Drawn
    from otwarp.scene.drawing.view import automatic_view

    def one(kind: int, matrix: np.ndarray, colour: Iterable[float], **more: object) -> Drawn:
        """A single solid."""
        look = {"size": (0.0, 0.0), "opacity": np.ones(1), **more}
        return Drawn(kind=kind, transform=matrix[None], colour=np.array([list(colour)]), **look)  # type: ignore[arg-type]

    drawn: dict[str, list[Drawn]] = {}
    for body in scene.bodies:
        colour = ROBOT if body.kind == "robot" else CELL
        faint = np.array([1.0 if body.kind == "robot" else 0.7])
        list_ = drawn.setdefault(body.prim, [])
        for sphere in body.spheres:
            matrix = _pose(body) @ _matrix(sphere.offset, (0, 0, 0, 1)) @ np.diag([*[sphere.radius] * 3, 1.0])
            list_.append(one(SPHERE, matrix, colour, opacity=faint))
        for rod in body.rods:
            a, b = np.array(rod.start), np.array(rod.end)
            half = max(0.5 * float(np.linalg.norm(b - a)), 1e-12)
            matrix = _pose(body) @ _matrix(0.5 * (a + b), align_z((b - a) / (2.0 * half)))
            matrix = matrix @ np.diag([*[rod.radius] * 3, 1.0])
            list_.append(one(CAPSULE, matrix, colour, size=(half / rod.radius, 0.0)))
    for o in scene.obstacles:
        kind, scale, size, mesh = _obstacle(o)
        matrix = _matrix(o.position.at(0.0), o.orientation.at(0.0)) @ np.diag([*scale, 1.0])
        drawn[o.prim] = [one(kind, matrix, THING, size=size, mesh=mesh, opacity=np.full(1, 0.35))]
    reach = [max(float(np.linalg.norm(s.offset)) + s.radius for s in b.spheres) for b in scene.bodies]
    centre = np.array([b.position for b in scene.bodies] or [(0.0, 0.0, 0.0)])
    r = np.array(reach or [10.0])[:, None]
    return drawn, automatic_view(centre - r, centre + r, np.array([0.0, 0.0, 1.0]))


def _obstacle(o: Obstacle) -> tuple[int, tuple[float, float, float], tuple[float, float], TriangleMesh | None]:
    """Kind, scale, size and mesh of an obstacle's canonical solid."""
    a, b, _ = o.size
    if o.shape == "box":
        return BOX, o.size, (0.0, 0.0), None
    if o.shape == "sphere":
        return SPHERE, (a, a, a), (0.0, 0.0), None
    top = SHAPES[o.shape].top
    if top is not None:
        return TUBE, (a, a, b), (top, 0.0), None
    if o.shape == "capsule":
        return CAPSULE, (a, a, a), (b / a, 0.0), None
    if o.shape == "mesh":
        faces = np.asarray(o.triangles).reshape(-1, 3)
        mesh = TriangleMesh(points=o.vertices, triangles=faces, normals=np.zeros((len(faces), 3, 3)))
        return MESH, (1.0, 1.0, 1.0), (0.0, 0.0), mesh
    return PLANE, (1.0, 1.0, 1.0), (100.0, 100.0), None


def _parts(drawn: Iterable[Drawn], frame: np.ndarray) -> tuple[MeshPart, ...]:
    """Solids in the frame with this pose, merged by colour and opacity."""
    inverse, groups = np.linalg.inv(frame), {}
    drawn = list(drawn)
    sizes = [float(np.cbrt(np.abs(np.linalg.det(d.transform[:, :3, :3])).max(initial=0.0))) for d in drawn]
    for d, size in zip(drawn, sizes, strict=True):
        triangles = solid(d.kind, d.size, d.mesh, small=size < SMALL * max(sizes))
        for matrix, colour, opacity in zip(d.transform, d.colour, d.opacity, strict=True):
            key = (display(colour), round(float(opacity), 3))
            groups.setdefault(key, []).append(placed(triangles, inverse @ matrix))
    return tuple(
        MeshPart(vertices=points.astype(np.float32), faces=faces.astype(np.uint32), colour=colour, opacity=opacity)
        for (colour, opacity), many in groups.items()
        for points, faces in [merged(many)]
    )


def _balls(scene: Scene, single: list[int], by_owner: dict[str, list[Drawn]]) -> tuple[BallGroup, ...]:
    """One group per opacity: few messages, whatever the number of cells."""
    groups: dict[float, list[tuple[int, float, Colour]]] = {}
    for i in single:
        body = scene.bodies[i]
        drawn = by_owner.get(body.prim, [])
        if not drawn:  # invisible in the stage
            continue
        # an instancer lists its instances in order; masked ones are missing, then all look like the first
        k = (body.instance or 0) if (body.instance or 0) < len(drawn[0].colour) else 0
        opacity = round(float(drawn[0].opacity[k]), 3)
        groups.setdefault(opacity, []).append((i, body.spheres[0].radius, display(drawn[0].colour[k])))
    return tuple(
        BallGroup(
            bodies=np.array([row[0] for row in rows]),
            radii=np.array([row[1] for row in rows]),
            colours=np.array([row[2] for row in rows], dtype=np.uint8),
            opacity=opacity,
        )
        for opacity, rows in groups.items()
    )


def _is_ball(body: Body) -> bool:
    return len(body.spheres) == 1 and not body.rods and math.hypot(*body.spheres[0].offset) < CENTRED


def _trap(scene: Scene, trap: Trap, drawn: Sequence[Drawn]) -> TrapDrawing:
    body, sphere = _held(scene, trap)
    held = scene.bodies[body].spheres[sphere] if body >= 0 else None
    reach = trap.reach
    if trap.radial is not None:
        similar = held.radius / trap.radial.radius if held and trap.radial.radius > 0.0 else 1.0
        reach = trap.radial.cutoff * similar
    return TrapDrawing(
        name=trap.prim.rsplit("/", 1)[-1].replace("_", " "),
        hand=trap.hand,
        position=vec3(trap.position.at(0.0)),
        power=float(trap.power.at(0.0)[0]),
        orientation=trap.orientation,
        colour=display(drawn[0].colour[0] if drawn else LIGHT[trap.hand]),
        reach=float(reach),
        held=body,
        offset=held.offset if held else (0.0, 0.0, 0.0),
        radius=held.radius if held else 0.0,
    )


def _held(scene: Scene, trap: Trap) -> tuple[int, int]:
    """Body and sphere that a trap is meant to hold: the named one, else the nearest trapped one at the start."""
    spheres = [(i, k, s) for i, b in enumerate(scene.bodies) for k, s in enumerate(b.spheres) if s.trapped]
    if trap.holds is not None:
        return next(((i, k) for i, k, s in spheres if s.prim == trap.holds), (-1, 0))
    if not spheres:
        return -1, 0
    held = [(scene.bodies[i], np.array(s.offset)) for i, _, s in spheres]
    centres = np.array([rotate(np.array(body.orientation), offset) + body.position for body, offset in held])
    return spheres[int(np.argmin(np.linalg.norm(centres - trap.position.at(0.0), axis=1)))][:2]


def _touching(bodies: Sequence[Body]) -> tuple[np.ndarray, np.ndarray]:
    """Of each body the centre and reach of what touches: colliding spheres without a trap, else all that collide."""
    centres, reaches = np.zeros((len(bodies), 3)), np.zeros(len(bodies))
    for i, body in enumerate(bodies):
        colliding = [s for s in body.spheres if s.collides] or list(body.spheres)
        part = [s for s in colliding if not s.trapped] or colliding
        if len(part) == 1:  # ten thousand cells
            centres[i], reaches[i] = part[0].offset, part[0].radius
            continue
        centres[i] = np.mean([s.offset for s in part], axis=0)
        reaches[i] = max(float(np.linalg.norm(s.offset - centres[i])) + s.radius for s in part)
    return centres, reaches


def _camera(view: View) -> CameraDrawing:
    """A perspective camera that sees all of the view's window; an orthographic one is moved far off instead."""
    window = max(view.height, view.width / NARROW)
    fov = 2.0 * math.atan(0.5 * window)
    position, look_at = np.asarray(view.position), view.position + view.focus * view.forward
    if view.orthographic:
        fov = math.radians(20.0)
        position = look_at - view.forward * (0.5 * window / math.tan(0.5 * fov))
    distance = float(np.linalg.norm(look_at - position))
    return CameraDrawing(
        position=vec3(position),
        look_at=vec3(look_at),
        up=vec3(view.up),
        fov=fov,
        near=distance / 200.0,
        far=distance * 20.0,
    )


def _short(body: Body) -> str:
    name = body.prim.rsplit("/", 1)[-1].replace("_", " ")
    return name if body.instance is None else f"{name} {body.instance}"


def _pose(body: Body) -> np.ndarray:
    return _matrix(body.position, body.orientation)


def _matrix(position: Sequence[float] | np.ndarray, orientation: Sequence[float] | np.ndarray) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation_matrix(np.asarray(orientation, dtype=float)), position
    return matrix


@cache
def ball(subdivisions: int = 3) -> Triangles:
    """Unit sphere: an icosahedron whose triangles are cut in four `subdivisions` times (20·4ⁿ faces)."""
    g = (1.0 + 5.0**0.5) / 2.0
    corners = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g)]
    corners += [(0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]
    points = [np.array(c) / np.linalg.norm(c) for c in corners]
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6)]
    faces += [(7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10)]
    faces += [(8, 6, 7), (9, 8, 1)]
    for _ in range(subdivisions):
        middles: dict[tuple[int, int], int] = {}

        def middle(a: int, b: int, middles: dict[tuple[int, int], int] = middles) -> int:
            """Index of the point halfway between two, on the sphere."""
            key = (min(a, b), max(a, b))
            if key not in middles:
                m = points[a] + points[b]
                points.append(m / np.linalg.norm(m))
                middles[key] = len(points) - 1
            return middles[key]

        cut = []
        for a, b, c in faces:
            d, e, f = middle(a, b), middle(b, c), middle(c, a)
            cut += [(a, d, f), (d, b, e), (f, e, c), (d, e, f)]
        faces = cut
    return np.array(points), np.array(faces)


def box() -> Triangles:
    """Cube from −1 to 1; each face has its own corners, so that edges stay sharp."""
    points, faces = [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            a, b = (axis + 1) % 3, (axis + 2) % 3
            first = len(points)
            for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                p = np.zeros(3)
                p[axis], p[a], p[b] = side, u * side, v
                points.append(p)
            faces += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    return np.array(points), np.array(faces)


def turned(profile: np.ndarray, sides: int = SIDES) -> Triangles:
    """A curve (n, 2) of (radius, z), z rising, turned about z; open at its ends."""
    angle = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    r, z = profile[:, :1], profile[:, 1:]
    x, y, h = r * np.cos(angle), r * np.sin(angle), np.broadcast_to(z, (len(profile), sides))
    points = np.stack([x, y, h], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(len(profile) - 1), np.arange(sides), indexing="ij")
    k = (j + 1) % sides
    a, b, c, d = i * sides + j, i * sides + k, (i + 1) * sides + k, (i + 1) * sides + j
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return points, faces


def tube(top: float) -> Triangles:
    """Closed tube along z from −1 to 1 with radius 1 at −1 and `top` at +1."""
    wall = turned(np.array([[1.0, -1.0], [top, 1.0]]))
    ends = [[[0.0, -1.0], [1.0, -1.0]], [[top, 1.0], [0.0, 1.0]]][: 2 if top else 1]
    return merged([wall, *(turned(np.array(end)) for end in ends)])


def capsule(half: float) -> Triangles:
    """Radius 1 about the segment z = ±half."""
    angle = np.linspace(0.0, np.pi / 2.0, 6)
    upper = np.stack([np.cos(angle), half + np.sin(angle)], axis=1)
    return turned(np.concatenate([upper[::-1] * (1.0, -1.0), upper]), 18)


def rectangle(half_width: float, half_length: float) -> Triangles:
    """Rectangle in z = 0, normal +z."""
    w, h = min(half_width, FARTHEST_PLANE), min(half_length, FARTHEST_PLANE)
    return np.array([(-w, -h, 0), (w, -h, 0), (w, h, 0), (-w, h, 0)], dtype=float), np.array([(0, 1, 2), (0, 2, 3)])


def beam() -> Triangles:
    """A beam along z with its waist at the origin: w(z) = w₀·√(1 + (z/z₀)²), as that of a Gaussian beam [µm]."""
    rayleigh = BEAM_LENGTH / ((BEAM_RADIUS / BEAM_WAIST) ** 2 - 1.0) ** 0.5
    z = BEAM_LENGTH * np.sin(np.linspace(-np.pi / 2.0, np.pi / 2.0, 33)) ** 3  # closer together near the waist
    return turned(np.stack([BEAM_WAIST * np.sqrt(1.0 + (z / rayleigh) ** 2), z], axis=1), 24)


def solid(kind: int, size: tuple[float, float], mesh: TriangleMesh | None = None, *, small: bool = False) -> Triangles:
    """A canonical solid of `otwarp.scene.drawing.draw_list`; of a small ball nobody sees the corners of fewer faces."""
    if kind == SPHERE:
        return ball(2 if small else 3)
    if kind == BOX:
        return box()
    if kind == TUBE:
        return tube(size[0])
    if kind == CAPSULE:
        return capsule(size[0])
    if kind == PLANE:
        return rectangle(*size)
    if kind == MESH and mesh is not None:
        return mesh.points, mesh.triangles
    raise ValueError(f"solid kind = {kind}: must be one of the draw list's, a mesh with its triangles")


def placed(triangles: Triangles, matrix: np.ndarray) -> Triangles:
    """The same solid under an affine map (4, 4); a reflection turns the faces over."""
    points, faces = triangles
    moved = points @ matrix[:3, :3].T + matrix[:3, 3]
    return moved, faces[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0.0 else faces


def merged(many: list[Triangles]) -> Triangles:
    """Several solids as one: their vertices one after the other, faces renumbered."""
    shift = np.cumsum([0] + [len(points) for points, _ in many])
    return (
        np.concatenate([points for points, _ in many]),
        np.concatenate([faces + k for (_, faces), k in zip(many, shift, strict=False)]),
    )
