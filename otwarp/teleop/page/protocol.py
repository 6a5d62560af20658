"""What the session and its page's process say to each other: what is drawn, what happens, and how it passes a pipe.

Session → page: a `PageOrder` once, with the `Drawing`, then `PageFrame` or a line of complaint. Page → session: `Ready`
or `Failed` once, then `Shown` for each frame (the credit for the next one), `Asked` for what the user did, `Visitors`.
Both ends are ours and the pipe is nobody else's, so pickles may pass.

Drawings are plain arrays in µm; colours are sRGB from 0 to 255, quaternions (x, y, z, w).
"""

from __future__ import annotations

import pickle
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, BinaryIO

import numpy as np

from otwarp.haptics.core import Vec3
from otwarp.haptics.core.fields import Matrix
from otwarp.haptics.servo.link import ServoStatus
from otwarp.teleop import Command, HandFrame, LiveFrame, PaceNow
from otwarp.teleop.perception import PerceptionNow

_LENGTH = struct.Struct("!Q")
Colour = tuple[int, int, int]


@dataclass(frozen=True, eq=False, kw_only=True)
class PageOrder:
    """All that the page's process must know; `port` None for the first free one from the usual one on."""

    drawing: Drawing
    host: str
    port: int | None
    token: str | None
    pointers: Mapping[str, str]
    axis_maps: Mapping[str, Matrix]


@dataclass(frozen=True, eq=False, kw_only=True)
class PageFrame:
    """What of a `LiveFrame` the page shows, for B bodies and T traps in float32.

    Attributes:
        stamp: `time.monotonic()` of its publication [s]; one clock for all processes of a machine.
        position, orientation: (B, 3) and (B, 4) of the bodies' prims.
        trap_position, trap_power, trap_force, trap_distance: (T, 3), (T,), (T, 3), (T,).
        contact_force, contact_load: (B, 3), (B,).
        beat, time, hand_force, hands, servo, pace, warnings, task, recording, trap_goals, engine, perceived: See
            `LiveFrame` and `Frame`.
    """

    stamp: float
    beat: int
    time: float
    position: np.ndarray
    orientation: np.ndarray
    trap_position: np.ndarray
    trap_power: np.ndarray
    trap_force: np.ndarray
    trap_distance: np.ndarray
    contact_force: np.ndarray
    contact_load: np.ndarray
    hand_force: np.ndarray
    hands: tuple[HandFrame, ...]
    servo: ServoStatus | None
    pace: PaceNow
    warnings: tuple[str, ...]
    task: str
    recording: str | None
    trap_goals: Mapping[int, Vec3] = field(default_factory=dict)
    engine: str = ""
    perceived: PerceptionNow | None = None

    @classmethod
    def of(cls, live: LiveFrame, stamp: float) -> PageFrame:
        """Copies, so that the session may overwrite its arrays."""
        arrays = ("position", "orientation", "trap_position", "trap_power", "trap_force", "trap_distance")
        names = (*arrays, "contact_force", "contact_load")
        return cls(
            stamp=stamp,
            beat=live.beat,
            time=live.frame.time,
            **{name: np.array(getattr(live.frame, name)[0], dtype=np.float32) for name in names},
            hand_force=np.array(live.hand_force, dtype=np.float32),
            hands=live.hands,
            servo=live.servo,
            pace=live.pace,
            warnings=live.warnings,
            task=live.task,
            recording=live.recording,
            trap_goals=dict(live.trap_goals),
            engine=live.engine,
            perceived=live.perceived,
        )


@dataclass(frozen=True, slots=True)
class Complaint:
    """A line that the page's users should read."""

    line: str


@dataclass(frozen=True, slots=True)
class Ready:
    """The page listens on this port; who comes needs this token, None for none."""

    port: int
    token: str | None


@dataclass(frozen=True, slots=True)
class Failed:
    """The page cannot be; why."""

    line: str


@dataclass(frozen=True, slots=True)
class Shown:
    """A frame was applied: the next one may come.

    Attributes:
        beat: Of the frame.
        delay: The latest `child.BrowserLatency.delay` [s], None without one.
    """

    beat: int
    delay: float | None = None


@dataclass(frozen=True, slots=True)
class Asked:
    """A user of the page gave a command."""

    command: Command


@dataclass(frozen=True, slots=True)
class Visitors:
    """How many browser windows look."""

    count: int


def send(pipe: BinaryIO, message: object) -> None:
    """Write a message and flush; OSError or ValueError when the other side has gone."""
    body = pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
    pipe.write(_LENGTH.pack(len(body)))
    pipe.write(body)
    pipe.flush()


def receive(pipe: BinaryIO) -> Any:
    """The next message.

    Raises:
        EOFError: The other side has gone, in mid-message or between two.
    """
    head = pipe.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        raise EOFError("the pipe has ended")
    size = _LENGTH.unpack(head)[0]
    body = pipe.read(size)
    if len(body) < size:
        raise EOFError("the pipe has ended in mid-message")
    return pickle.loads(body)


@dataclass(frozen=True, eq=False, kw_only=True)
class MeshPart:
    """Triangles of one colour: vertices (n, 3) float32, faces (m, 3) uint32."""

    vertices: np.ndarray
    faces: np.ndarray
    colour: Colour
    opacity: float = 1.0


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyDrawing:
    """A body drawn by parts in its own frame; `index` is that of the scene."""

    index: int
    parts: tuple[MeshPart, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class BallGroup:
    """Bodies that are one ball about their origin, drawn as instances of one mesh.

    Attributes:
        bodies: (n,) indices.
        radii: (n,) µm.
        colours: (n, 3) uint8.
        opacity: Of all of them.
    """

    bodies: np.ndarray
    radii: np.ndarray
    colours: np.ndarray
    opacity: float


@dataclass(frozen=True, eq=False, kw_only=True)
class MovingDrawing:
    """An obstacle that moves along time samples: its parts in its own frame, and its tracks.

    Attributes:
        parts: Of it.
        times: (n,) and (m,) sample times of position and orientation [s].
        position: (n, 3) µm.
        orientation: (m, 4).
    """

    parts: tuple[MeshPart, ...]
    times: tuple[np.ndarray, np.ndarray]
    position: np.ndarray
    orientation: np.ndarray

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Position and unit quaternion at a time [s]; quaternions are interpolated along the chord."""
        p = np.array([np.interp(time, self.times[0], column) for column in self.position.T])
        q = np.array([np.interp(time, self.times[1], column) for column in self.orientation.T])
        return p, q / np.linalg.norm(q)


@dataclass(frozen=True, eq=False, kw_only=True)
class TrapDrawing:
    """A trap.

    Attributes:
        name: Short name for labels.
        hand: `left`, `right` or `none`.
        position: Focus at the start [µm].
        power: At the start [mW].
        orientation: Of the beam, which travels along its +Z.
        colour: Of its light.
        reach: Distance from the focus where its force ends [µm], inf for none.
        held: Index of the body that it is meant to hold, −1 for none.
        offset: Centre of the held sphere in that body's frame [µm].
        radius: Of that sphere [µm].
    """

    name: str
    hand: str
    position: tuple[float, float, float]
    power: float
    orientation: tuple[float, float, float, float]
    colour: Colour
    reach: float
    held: int = -1
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    radius: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraDrawing:
    """Where the page looks from at first: places [µm], vertical field of view [rad], clipping distances [µm]."""

    position: tuple[float, float, float]
    look_at: tuple[float, float, float]
    up: tuple[float, float, float]
    fov: float
    near: float
    far: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Drawing:
    """Everything drawn.

    Attributes:
        title: Of the page.
        names: Short names of the bodies.
        robots: (B,) whether a body is a robot.
        warning_force: (B,) contact load above which a body's user is warned [pN].
        touching: (B, 3) centre of the part of each body that touches things, in its frame, and (B,) its reach [µm].
        bodies, balls, fixed, moving, traps: What is drawn.
        position, orientation: (B, 3) and (B, 4) at the start.
        distance_warning: Of the task, the distance of a trap from its sphere above which it warns, inf for none [µm].
        camera: See there.
    """

    title: str
    names: tuple[str, ...]
    robots: np.ndarray
    warning_force: np.ndarray
    touching: tuple[np.ndarray, np.ndarray]
    bodies: tuple[BodyDrawing, ...]
    balls: tuple[BallGroup, ...]
    fixed: tuple[MeshPart, ...]
    moving: tuple[MovingDrawing, ...]
    traps: tuple[TrapDrawing, ...]
    position: np.ndarray
    orientation: np.ndarray
    distance_warning: float
    camera: CameraDrawing
