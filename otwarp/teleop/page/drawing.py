"""What the page draws, as plain arrays in µm that pass from the session's process to the page's.

Colours are sRGB from 0 to 255, quaternions (x, y, z, w).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Colour = tuple[int, int, int]


@dataclass(frozen=True, eq=False, kw_only=True)
class Part:
    """Triangles of one colour: vertices (n, 3) float32, faces (m, 3) uint32."""

    vertices: np.ndarray
    faces: np.ndarray
    colour: Colour
    opacity: float = 1.0


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyDrawing:
    """A body drawn by parts in its own frame; `index` is that of the scene."""

    index: int
    parts: tuple[Part, ...]


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

    parts: tuple[Part, ...]
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
    fixed: tuple[Part, ...]
    moving: tuple[MovingDrawing, ...]
    traps: tuple[TrapDrawing, ...]
    position: np.ndarray
    orientation: np.ndarray
    distance_warning: float
    camera: CameraDrawing
