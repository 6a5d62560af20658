"""What a recording shows in three dimensions, and its JSON: frames that exist, metres, times that go on, schemas."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from otwarp import teleop as c
from otwarp.haptics.core.config import FACING_USER
from otwarp.haptics.recording import SCHEMAS, START, McapFile, unpack_text
from otwarp.scene import Body, Goal, Obstacle, Rod, Sphere, Track
from otwarp.scene.transforms import rotation_matrix
from otwarp.teleop.recording.scenery import COLOURS, JSON, device_rotation, shapes
from tests.teleop.recording.test_writer import SCENE, begin, cycles, frame, messages, scene_now

QUARTER = (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))
"""About y: +z to +x."""


def schema_of(topic: str):
    """Of its messages; None if they are not JSON."""
    return JSON[START] if topic.startswith(START) else JSON.get(topic)


def obstacle(shape: str, size=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0, 1.0), **more) -> Obstacle:
    still = {"position": Track.constant((1.0, 2.0, 3.0)), "orientation": Track.constant(turn)}
    return Obstacle(prim=f"/World/{shape}", shape=shape, size=size, **still | more)


TRIANGLE = {"vertices": np.eye(3), "triangles": np.array([[0, 1, 2]], dtype=np.int32)}
SWINGS = {"position": Track(times=np.array([0.0, 1.0]), values=np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0]]))}
RODDED = Body(
    prim="/World/robot",
    position=(1.0, 0.0, 0.0),
    spheres=(Sphere(prim="/World/robot/s", offset=(0.0, 2.0, 0.0), radius=0.5),),
    rods=(Rod(prim="/World/robot/r", start=(0.0, 0.0, 0.0), end=(3.0, 0.0, 0.0), radius=0.25),),
)
FULL = replace(
    SCENE,
    bodies=(*SCENE.bodies[:2], RODDED),
    obstacles=(
        obstacle("plane"),
        obstacle("box", (1.0, 2.0, 3.0)),
        obstacle("sphere", (1.5, 0.0, 0.0)),
        obstacle("capsule", (1.0, 2.0, 0.0), QUARTER),
        obstacle("cylinder", (1.0, 2.0, 0.0), **SWINGS),
        obstacle("mesh", **TRIANGLE),
    ),
    goal=Goal(
        prim="/World/goal", position=(9.0, 0.0, 0.0), cell="/World/robot", robots=(), tolerance=2.0, lost_distance=5.0,
        cell_lost_distance=5.0, distance_warning=1.0,
    ),
)  # fmt: skip


@pytest.fixture(scope="module")
def take(tmp_path_factory) -> Path:
    """A recording of everything that can be drawn, whose parts come out of order, as those of a session do."""
    path = tmp_path_factory.mktemp("markers") / "take.mcap"
    with begin(path, scene=FULL, settings={"seed": 1, "law": "compiled"}) as recording:
        for n in range(1, 60):
            live = frame(n, warnings=("trap 1: lost",) if n == 3 else ())
            recording.frame(replace(live, frame=replace(live.frame, time=0.5)), scene_now(n))
            recording.cycles("left", cycles(3 * n, 3))
            recording.command(c.SetGains("left", None, 0.1 * n), 5.0 + 0.002 * n)
    return path


def test_markers_stand_in_frames_that_move_and_are_as_large_as_the_scene(take):
    (_, drawn), *rest = messages(take)["/scene/markers"]
    assert not rest and len(drawn.markers) == len(list(shapes(FULL)))
    assert len({marker.id for marker in drawn.markers}) == len(drawn.markers) and all(
        m.frame_locked for m in drawn.markers
    )
    told: dict[tuple[str, str, int], list] = {}
    for marker in drawn.markers:
        told.setdefault((marker.header.frame_id, marker.ns, marker.type), []).append(marker)
        assert (marker.color.r, marker.color.a) == pytest.approx(np.float32(COLOURS[marker.ns])[[0, 3]])

    def one(*which):
        (marker,) = told[which]
        at, q, size = marker.pose.position, marker.pose.orientation, marker.scale
        return [1e6 * x for x in (at.x, at.y, at.z)], [q.x, q.y, q.z, q.w], [1e6 * x for x in (size.x, size.y, size.z)]

    rod = one("World/robot", "robot", 3)
    assert rod[0] == pytest.approx([1.5, 0.0, 0.0]) and rod[2] == pytest.approx([0.5, 0.5, 3.0])
    assert rotation_matrix(np.array(rod[1]))[:, 2] == pytest.approx([1.0, 0.0, 0.0])
    ball, *ends = told["World/robot", "robot", 2]
    assert (ball.pose.position.y, ball.scale.x) == pytest.approx((2e-6, 1e-6)) and len(ends) == 2
    assert one("world", "goal", 2) == ([9.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0], pytest.approx([4.0] * 3))
    # the capsule lies along x; what moves has a frame of its own
    round_ones = [[1e6 * p for p in (m.pose.position.x, m.pose.position.z)] for m in told["world", "obstacle", 2]]
    assert sorted(round_ones) == [pytest.approx([-1.0, 3.0]), pytest.approx([1.0, 3.0]), pytest.approx([3.0, 3.0])]
    assert one("World/cylinder", "obstacle", 3)[0] == [0.0, 0.0, 0.0]
    plane, box = told["world", "obstacle", 1]
    assert plane.pose.position.z + 0.5 * plane.scale.z == pytest.approx(3e-6) and box.scale.z == pytest.approx(6e-6)
    # corners and arrows are in metres, too: triangles have no scale of their own
    (mesh,) = told["world", "obstacle", 11]
    assert ([p.x for p in mesh.points], mesh.scale.x) == ([1e-6, 0.0, 0.0], 1.0)
    arrow = next(marker for marker in drawn.markers if marker.type == 0)
    assert arrow.points[1].z == 0.0 and -1e-5 < arrow.points[0].z < 0.0


def test_every_frame_is_in_one_tree(take):
    told = messages(take)
    children = [t.child_frame_id for _, tf in told["/tf"] + told["/tf_static"] for t in tf.transforms]
    assert all(t.header.frame_id == "world" for _, tf in told["/tf"] + told["/tf_static"] for t in tf.transforms)
    named = {marker.header.frame_id for marker in told["/scene/markers"][0][1].markers}
    named |= {message.header.frame_id for topic in ("pose", "force") for _, message in told[f"/hand/left/{topic}"]}
    assert named <= {"world", *children} and "left_device" in named
    assert not any(name.startswith("/") for name in named)
    swinging = [
        t.transform.translation.x
        for _, tf in told["/tf"]
        for t in tf.transforms
        if t.child_frame_id == "World/cylinder"
    ]
    assert swinging == pytest.approx([2e-6] * 59)
    assert max(abs(t.transform.translation.x) for _, tf in told["/tf"] for t in tf.transforms) < 1e-4


def test_a_device_is_turned_as_its_axes_are_mapped():
    turn = rotation_matrix(np.array(device_rotation(FACING_USER)))
    np.testing.assert_allclose(turn, FACING_USER, atol=1e-15)
    mirrored = ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0))
    assert device_rotation(mirrored) == (0.0, 0.0, 0.0, 1.0)


def test_times_never_go_back(take):
    with McapFile(take) as file:
        times = [message.time for message in file.messages()]
    assert times == sorted(times) and times[-1] > times[0]


@cache
def texts(path: Path) -> tuple[tuple[str, str], ...]:
    """(topic, text) of all messages that are text."""
    with McapFile(path) as file:
        return tuple((m.topic, unpack_text(m.data)) for m in file.messages() if m.kind == "std_msgs/msg/String")


def test_all_json_is_as_its_schema_says(take):
    schema = pytest.importorskip("jsonschema", reason="of the extra dev")
    told = dict(texts(take))[SCHEMAS]
    assert set(json.loads(told)) == set(JSON)
    for one in json.loads(told).values():
        schema.Draft202012Validator.check_schema(one)
    found = set()
    for topic, text in texts(take):
        if topic not in (SCHEMAS, "/warnings"):
            schema.validate(json.loads(text), schema_of(topic), schema.Draft202012Validator)
            found.add(topic)
    assert found == {"/otwarp/config", "/otwarp/commands", "/otwarp/pace", "/otwarp/start/left", "/otwarp/end"}


def test_schemas_refuse_what_is_none():
    schema = pytest.importorskip("jsonschema", reason="of the extra dev")
    for topic, bad in (
        ("/otwarp/pace", {"beat": 1}),
        ("/otwarp/end", {"dropped": -1, "lost": {}}),
        ("/otwarp/start/left", []),
    ):
        with pytest.raises(schema.ValidationError):
            schema.validate(bad, schema_of(topic), schema.Draft202012Validator)


def test_the_reader_of_foxgloves_makers_decodes_all_of_it(take):
    reader = pytest.importorskip("mcap.reader", reason="of the extra dev")
    decoder = pytest.importorskip("mcap_ros2.decoder", reason="of the extra dev")
    with take.open("rb") as file:
        opened = reader.make_reader(file, decoder_factories=[decoder.DecoderFactory()])
        summary = opened.get_summary()
        assert summary is not None and summary.statistics is not None
        kinds = {summary.schemas[channel.schema_id].name for channel in summary.channels.values()}
        assert {"visualization_msgs/msg/MarkerArray", "tf2_msgs/msg/TFMessage"} <= kinds
        decoded = list(opened.iter_decoded_messages(log_time_order=False))
    assert len(decoded) == summary.statistics.message_count > 300
