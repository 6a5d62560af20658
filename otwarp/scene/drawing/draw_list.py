"""What a picture needs of a stage at one instant, as plain NumPy arrays in µm. Knows neither USD nor Warp.

Every shape is a *canonical* solid placed by an affine transform, so that any scale, also a non-uniform one, is exact:

| kind | canonical solid | parameter |
|---|---|---|
| `SPHERE` | unit ball | none |
| `BOX` | cube from −1 to 1 | none |
| `TUBE` | axis z from −1 to 1, radius 1 at −1 (cylinder, cone, frustum) | radius at +1 |
| `CAPSULE` | radius 1 about the segment z = ±half height | half height |
| `PLANE` | rectangle in z = 0, normal +z, centred | half width, half length (inf allowed) |
| `MESH` | triangles | none; index of the mesh |
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

SPHERE, BOX, TUBE, CAPSULE, PLANE, MESH = range(6)

EMPTY = np.full((1, 3), -10.0), np.full((1, 3), 10.0)
"""Lower and upper corner of the box that is framed where there is nothing to see [µm]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TriangleMesh:
    """Triangles in their own frame.

    Attributes:
        points: (n, 3) vertices.
        triangles: (m, 3) vertex indices, counter-clockwise seen from outside.
        normals: (m, 3, 3) unit normal at each corner of each triangle.
    """

    points: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray


@dataclass(frozen=True, eq=False, kw_only=True)
class View:
    """A camera in world coordinates.

    Attributes:
        prim: Path of its prim, empty for the automatic one.
        position: (3,) µm.
        right, up, forward: (3,) unit vectors.
        orthographic: Whether rays are parallel.
        width, height: Full size of the window: µm for an orthographic camera, else its size at unit distance
            (2·tan of half the field of view). The picture contains the whole window.
        shift: (2,) offset of the window's centre, in the unit of `width`.
        near, far: Clipping distances along `forward` [µm].
        focus: Distance at which lengths in the picture are measured [µm].
    """

    prim: str = ""
    position: np.ndarray
    right: np.ndarray
    up: np.ndarray
    forward: np.ndarray
    orthographic: bool = False
    width: float
    height: float
    shift: tuple[float, float] = (0.0, 0.0)
    near: float = 0.0
    far: float = float("inf")
    focus: float

    def window(self, width: int, height: int) -> tuple[float, float]:
        """Window fitted to a picture of `width` × `height` pixels: the smallest of its shape that contains this one."""
        aspect = width / height
        wider = aspect > self.width / self.height
        return (self.height * aspect, self.height) if wider else (self.width, self.width / aspect)

    def pixel_size(self, width: int, height: int) -> float:
        """Length that one pixel of a `width` × `height` picture covers at the focus distance [µm]."""
        size = self.window(width, height)[0] / width
        return size if self.orthographic else size * self.focus


@dataclass(frozen=True, eq=False, kw_only=True)
class Lights:
    """Lights, in relative units: the renderer sets the exposure.

    Attributes:
        vector: (n, 3) unit vector towards a distant light, or position of a local one [µm].
        distant: (n,) bool.
        irradiance: (n, 3) linear colour times irradiance at the centre of the scene.
        ambient: (3,) linear colour times irradiance of the dome.
    """

    vector: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    distant: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    irradiance: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    ambient: np.ndarray = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True, eq=False, kw_only=True)
class Drawables:
    """Everything visible at one instant.

    Attributes:
        kind: (n,) one of `SPHERE` … `MESH`.
        transform: (n, 4, 4) float64, world = transform @ local, column vectors; from the canonical solid to µm.
        size: (n, 2) parameters of the kind (table above).
        colour: (n, 3) linear RGB.
        opacity: (n,) from 0 to 1.
        roughness: (n,) from 0 (mirror-like highlight) to 1 (matt).
        beam: (n,) bool: a glowing volume of light instead of a surface.
        mesh: (n,) index into `meshes`, −1 for the other kinds.
        meshes: Shared triangle meshes.
        view: The camera.
        lights: The lights of the stage; empty when it has none.
        up: (3,) up direction of the stage.
        time: Seconds from time code 0.
    """

    kind: np.ndarray
    transform: np.ndarray
    size: np.ndarray
    colour: np.ndarray
    opacity: np.ndarray
    roughness: np.ndarray
    beam: np.ndarray
    mesh: np.ndarray
    meshes: tuple[TriangleMesh, ...] = ()
    view: View
    lights: Lights = field(default_factory=Lights)
    up: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    time: float = 0.0

    def __len__(self) -> int:
        return len(self.kind)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """(n, 3) lower and (n, 3) upper corners of every shape's box in world coordinates [µm]."""
        return bounds(self.kind, self.transform, self.size, self.mesh, self.meshes)


def bounds(
    kind: np.ndarray, transform: np.ndarray, size: np.ndarray, mesh: np.ndarray, meshes: tuple[TriangleMesh, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corners, (n, 3) each, of the world boxes of shapes (see `Drawables`)."""
    low, high = np.full((len(kind), 3), -1.0), np.full((len(kind), 3), 1.0)
    capsule, plane = kind == CAPSULE, kind == PLANE
    high[capsule, 2] = 1.0 + size[capsule, 0]
    high[plane, :2], high[plane, 2] = size[plane], 0.0
    for wide in (capsule, plane):
        low[wide] = -high[wide]
    for index, triangles in enumerate(meshes):
        low[mesh == index], high[mesh == index] = triangles.points.min(axis=0), triangles.points.max(axis=0)
    linear = transform[:, :3, :3]
    infinite = np.isinf(high).any(axis=1)
    low[infinite], high[infinite] = 0.0, 0.0
    centre, half = 0.5 * (low + high), 0.5 * (high - low)
    middle = np.einsum("nij,nj->ni", linear, centre) + transform[:, :3, 3]
    reach = np.einsum("nij,nj->ni", np.abs(linear), half)
    # A ball under an affine map has a tighter box than the box around it: the rows of the matrix give its half sizes.
    ball = kind == SPHERE
    reach[ball] = np.linalg.norm(linear[ball], axis=2)
    reach[infinite] = np.inf
    return middle - reach, middle + reach
