"""What a recording says once, for other programs: the scene as ROS 2 markers, and what its JSON looks like.

The markers, in metres, are what RViz and Foxglove draw of a recording in three dimensions. Each stands in the frame of
the body, trap or obstacle that it belongs to, and the recording's `/tf` moves the frames; so one
`visualization_msgs/MarkerArray` at the beginning is enough for all of it. Every topic whose messages are JSON texts has
a JSON Schema (draft 2020-12), which the recording holds itself, as its `/otwarp/schemas`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from otwarp.haptics.recording import COMMANDS, CONFIG, END, PACE, PERCEPTION, START
from otwarp.scene import IDENTITY, Scene
from otwarp.scene.description import Body, Obstacle, Trap
from otwarp.scene.transforms import align_z, quaternions, rotate
from otwarp.teleop import PaceNow

METRE = 1e-6
"""A micrometre in metres: markers and transforms have REP 103's units, whatever the scene is reckoned in."""
WORLD = "world"
"""Frame of the scene."""
PLANE = 100.0
"""Side of what is drawn of a plane, which has no end [µm]."""
BEAM, FOCUS = 3.0, 0.15
"""Length of the arrow along a beam, which ends in the focus, and the width of its head [µm]."""
COLOURS = {
    "robot": (0.35, 0.6, 0.9, 1.0),
    "cell": (0.9, 0.75, 0.45, 0.8),
    "trap": (0.9, 0.25, 0.2, 0.8),
    "obstacle": (0.6, 0.6, 0.62, 0.5),
    "goal": (0.3, 0.8, 0.4, 0.3),
}
_TYPES = {"arrow": 0, "box": 1, "sphere": 2, "cylinder": 3, "triangles": 11}
"""`Marker.type`."""


@dataclass(frozen=True, eq=False)
class Marker:
    """A marker.

    Attributes:
        frame: Of the coordinates.
        group: `robot`, `cell`, `trap`, `obstacle` or `goal`: its namespace and colour.
        kind: Of `_TYPES`.
        size: As `Marker.scale` [µm].
        position, orientation: In the frame [µm], quaternion (x, y, z, w).
        points: (n, 3) of an arrow or of triangles [µm].
    """

    frame: str
    group: str
    kind: str
    size: Sequence[float]
    position: Sequence[float] = (0.0, 0.0, 0.0)
    orientation: Sequence[float] = IDENTITY
    points: np.ndarray | None = None


def frame_of(name: str) -> str:
    """Name of a frame, which has no leading slash."""
    return name.lstrip("/")


def moving(obstacle: Obstacle) -> bool:
    """Whether an obstacle needs a frame of its own."""
    return obstacle.position.animated or obstacle.orientation.animated


def shapes(scene: Scene) -> Iterator[Marker]:
    """All that is drawn of a scene."""
    for body in scene.bodies:
        yield from _of_body(body)
    for trap in scene.traps:
        yield _of_trap(trap)
    for obstacle in scene.obstacles:
        yield from _of_obstacle(obstacle)
    if scene.goal is not None:
        yield Marker(WORLD, "goal", "sphere", (2.0 * scene.goal.tolerance,) * 3, scene.goal.position)


def _of_body(body: Body) -> Iterator[Marker]:
    frame = frame_of(body.name)
    for sphere in body.spheres:
        yield Marker(frame, body.kind, "sphere", (2.0 * sphere.radius,) * 3, sphere.offset)
    for rod in body.rods:
        start, end = np.array(rod.start), np.array(rod.end)
        length = float(np.linalg.norm(end - start))
        size = (2.0 * rod.radius, 2.0 * rod.radius, length)
        if length > 0.0:
            middle, turn = 0.5 * (start + end), align_z((end - start) / length)
            yield Marker(frame, body.kind, "cylinder", size, middle.tolist(), turn.tolist())
        for place in (rod.start, rod.end):
            yield Marker(frame, body.kind, "sphere", (2.0 * rod.radius,) * 3, place)


def _of_trap(trap: Trap) -> Marker:
    """An arrow along the beam, to the focus; a trap's frame does not turn."""
    beam = rotate(np.array(trap.orientation), np.array([0.0, 0.0, BEAM]))
    size = (0.5 * FOCUS, FOCUS, 2.0 * FOCUS)  # of an arrow by points: shaft, head, length of the head
    return Marker(frame_of(trap.prim), "trap", "arrow", size, points=np.stack([-beam, np.zeros(3)]))


def _of_obstacle(obstacle: Obstacle) -> Iterator[Marker]:
    """Its parts; a capsule has three."""
    frame, place, turn = WORLD, obstacle.position.at(0.0), obstacle.orientation.at(0.0)
    if moving(obstacle):
        frame, place, turn = frame_of(obstacle.prim), np.zeros(3), np.array(IDENTITY)
    turn = turn / np.linalg.norm(turn)

    def part(kind: str, size: Sequence[float], offset: Sequence[float] = (0.0, 0.0, 0.0), **more: Any) -> Marker:
        where = place + rotate(turn, np.array(offset))
        return Marker(frame, "obstacle", kind, size, where.tolist(), turn.tolist(), **more)

    x, y, z = obstacle.size
    if obstacle.shape == "plane":  # its normal is +Z, and what is below is solid
        yield part("box", (PLANE, PLANE, 0.01 * PLANE), (0.0, 0.0, -0.005 * PLANE))
    elif obstacle.shape == "box":
        yield part("box", (2.0 * x, 2.0 * y, 2.0 * z))
    elif obstacle.shape == "sphere":
        yield part("sphere", (2.0 * x,) * 3)
    elif obstacle.shape == "mesh":
        yield part("triangles", (1.0 / METRE,) * 3, points=obstacle.vertices[obstacle.triangles].reshape(-1, 3))
    else:
        if y > 0.0:
            yield part("cylinder", (2.0 * x, 2.0 * x, 2.0 * y))
        if obstacle.shape == "capsule":
            for end in (-y, y):
                yield part("sphere", (2.0 * x,) * 3, (0.0, 0.0, end))


def device_rotation(axis_map: Sequence[Sequence[float]]) -> tuple[float, float, float, float]:
    """Quaternion of a device's frame in the scene's, from the map of its axes; none for a map that mirrors."""
    a = np.array(axis_map, dtype=float)
    if np.linalg.det(a) < 0.0:
        return IDENTITY
    x, y, z, w = quaternions(a[None])[0].tolist()
    return x, y, z, w


def marker_array(scene: Scene, time: int, store: Any) -> Any:
    """`visualization_msgs/MarkerArray` of a scene.

    Args:
        scene: What is drawn.
        time: Its stamp [ns since 1970].
        store: `rosbags.typesys` store that has the types.
    """
    types = store.types
    vector, point = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Point"]
    turn, pose = types["geometry_msgs/msg/Quaternion"], types["geometry_msgs/msg/Pose"]
    head, stamp = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    now = stamp(sec=time // 10**9, nanosec=time % 10**9)
    image = types["sensor_msgs/msg/CompressedImage"]
    nothing = image(header=head(stamp=now, frame_id=""), format="", data=np.zeros(0, dtype=np.uint8))
    file = types["visualization_msgs/msg/MeshFile"](filename="", data=np.zeros(0, dtype=np.uint8))
    markers = []
    for n, shape in enumerate(shapes(scene)):
        corners = np.zeros((0, 3)) if shape.points is None else METRE * shape.points
        colour = types["std_msgs/msg/ColorRGBA"](**dict(zip("rgba", COLOURS[shape.group], strict=True)))
        markers.append(
            types["visualization_msgs/msg/Marker"](
                header=head(stamp=now, frame_id=shape.frame),
                ns=shape.group,
                id=n,
                type=_TYPES[shape.kind],
                action=0,
                pose=pose(
                    position=point(*(METRE * x for x in shape.position)),
                    orientation=turn(*map(float, shape.orientation)),
                ),
                scale=vector(*(METRE * x for x in shape.size)),
                color=colour,
                lifetime=types["builtin_interfaces/msg/Duration"](sec=0, nanosec=0),
                frame_locked=True,
                points=[point(*row) for row in corners.tolist()],
                colors=[],
                texture_resource="",
                texture=nothing,
                uv_coordinates=[],
                text="",
                mesh_resource="",
                mesh_file=file,
                mesh_use_embedded_materials=False,
            )
        )
    return types["visualization_msgs/msg/MarkerArray"](markers=markers)


DRAFT = "https://json-schema.org/draft/2020-12/schema"
_TEXT, _NUMBER, _COUNT = {"type": "string"}, {"type": "number"}, {"type": "integer", "minimum": 0}
_VECTOR = {"type": "array", "items": _NUMBER, "minItems": 3, "maxItems": 3}
_GAIN = {"type": ["number", "null"]}


def _object(about: str, required: dict[str, Any], **more: Any) -> dict[str, Any]:
    """An object that has all of `required`."""
    return {"type": "object", "description": about, "properties": required, "required": list(required), **more}


def _list(items: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items}


_CURVE = _object(
    "eq. 1 at 1 mW: K [pN/um], δ [um], A [pN um^2], C [pN], D [um]",
    {name: _NUMBER for name in ("stiffness", "threshold", "inverse_square", "constant", "cutoff")},
)
_GRID = _object(
    "nodes are float32, little-endian, base64",
    {"spacing": _NUMBER, "radius": _NUMBER, "end": _NUMBER, "columns": _COUNT, "node": _TEXT},
)
_LAW = {
    "oneOf": [
        _object(
            "one curve", {"kind": {"const": "isotropic"}, "curve": _CURVE, "axis": _VECTOR, "equilibrium": _NUMBER}
        ),
        _object(
            "across and along the beam",
            {
                "kind": {"const": "split"},
                "radial": _CURVE,
                "axial": _CURVE,
                "axis": _VECTOR,
                "equilibrium": _NUMBER,
            },
        ),
        _object(
            "a force table",
            {
                "kind": {"const": "table"},
                "grids": _list(_GRID),
                "layers": {"enum": [1, 2, 3]},
                "cubic": {"type": "boolean"},
                "scale": _NUMBER,
                "side": _VECTOR,
                "axis": _VECTOR,
            },
        ),
    ]
}
_PACE = {
    "beat": _COUNT,
    "wall": _NUMBER,
    "step": _COUNT,
    "simulated": _NUMBER,
    **{field.name: {"type": ["number", "boolean"]} for field in fields(PaceNow)},
}

JSON: dict[str, dict[str, Any]] = {
    CONFIG: _object(
        "how the session was set up: all that a replay needs beside samples and states",
        {
            "format": _COUNT,
            "otwarp": _TEXT,
            "recorded": _TEXT,
            "units": _TEXT,
            "haptics": _object("fields of HapticsConfig", {"hands": _list({"type": "object"})}),
            "devices": {"type": "object", "additionalProperties": _TEXT},
            "laws": _list(_LAW),
            "traps": {"type": "object", "additionalProperties": _list(_COUNT)},
            "kinds": _list(_COUNT),
            "settings": {"type": "object"},
            "clock": _object("t [s] of the loop is epoch + (t - began) ns", {"began": _NUMBER, "epoch": _COUNT}),
            "scene": _object(
                "what was simulated",
                {"file": {"type": ["string", "null"]}, "digest": _TEXT, "bodies": _list(_TEXT), "traps": _list(_TEXT)},
            ),
        },
    ),
    COMMANDS: _object("what was carried out, with its own fields", {"time": _NUMBER, "command": _TEXT}),
    PACE: _object("how simulated time followed the clock [s]", _PACE, additionalProperties=False),
    START: _object(
        "what the chain of a hand remembered before its first recorded cycle",
        {
            "tick": _COUNT,
            "chain": {
                "oneOf": [
                    {"type": "null"},
                    _object(
                        "a Rendering",
                        {
                            "gains": {"type": "array", "items": _GAIN, "minItems": 2, "maxItems": 2},
                            "device": {"type": ["object", "null"]},
                            "chain": {"type": ["object", "null"]},
                        },
                    ),
                ]
            },
        },
    ),
    PERCEPTION: _object(
        "a turn of the loop in which a camera is looked through: what its images said, and where bodies are for it",
        {
            "now": _NUMBER,
            "beat": {"type": ["integer", "null"]},
            "restarts": _COUNT,
            "ended": _TEXT,
            "trap_position": _list(_VECTOR),
            "trap_power": _list(_NUMBER),
            "looks": _list({"type": "object"}),
            "bodies": _list(_object("a body that is followed", {"body": _COUNT, "why": _TEXT})),
        },
    ),
    END: _object("what is missing", {"dropped": _COUNT, "lost": {"type": "object", "additionalProperties": _COUNT}}),
}
"""Topic → schema of its messages; that of `START` is for every hand."""


def schemas() -> dict[str, Any]:
    """For a recording: topic → schema; one that ends in `/` is for all that begin so."""
    return {topic: {"$schema": DRAFT, "title": topic, **schema} for topic, schema in JSON.items()}
