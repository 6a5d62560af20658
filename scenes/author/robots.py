"""The five-element robot, its looks and its traps.

Two spherical handles stand at the ends of a shallow U that is bowed upwards; its middle carries the hub. The five
elements handle – arm – hub – arm – handle are what traps act on. In front of the hub a ring of small spheres forms a
dish: a cell squeezed between two dishes cannot pop out sideways, as it would between two convex hubs. The ring
collides and is not trapped; the hub, hidden behind it, is trapped and does not collide.

The frame: +X is the way the dish faces, Y runs from handle to handle, Z is up. The origin is the centre of the two
handles and the hub, on the axis of the dish, so that a push along the axis turns the robot as little as can be. The
U is swept back, too: three traps in one line could not hold the robot against pitching.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from otwarp.laws import TrapLaw
from otwarp.scene import IDENTITY, Body, Material, Sphere, Track, Trap, Vec3
from scenes.author import trap_laws

if TYPE_CHECKING:
    from otwarp.scene import SceneBuilder

Color = tuple[float, float, float]

HANDLE_RADIUS = 1.525
HANDLE_SPAN = 9.55
ARM_RADIUS = 0.9
HUB_RADIUS = 1.5
BOW = 0.9
SWEEP = 5.0
RING_RADIUS = 1.35
RING_SPHERE_RADIUS = 0.55
RING_COUNT = 8
RING_AHEAD = 1.4
STRUT_RADIUS = 0.4
"""All in µm: the bow is how far the handles stand above the hub, the sweep how far behind it."""

RESIST_INDEX = 1.52
RESIST = Material(youngs_modulus=1e6, poisson_ratio=0.4)
"""Two-photon resist; its modulus is lowered to what a contact with a soft cell can still tell from rigid."""

ELEMENTS = ("handle_left", "arm_left", "hub", "arm_right", "handle_right")
HELD_ELEMENTS = ("handle_left", "hub", "handle_right")


def rounded(vector: object, digits: int = 6) -> Vec3:
    """A 3-vector as plain floats, rounded so that the shipped text is the same on every platform."""
    x, y, z = (float(v) + 0.0 for v in np.round(np.asarray(vector, dtype=float), digits))
    return x, y, z


def element_offset(element: str, sweep: float = SWEEP) -> np.ndarray:
    """(3,) place of one of the five elements in the robot's frame [µm], on a parabola through handles and hub."""
    along = dict(zip(ELEMENTS, (1.0, 0.5, 0.0, -0.5, -1.0), strict=True))[element]
    hub = np.array([2 / 3 * sweep, 0.0, -2 / 3 * BOW])
    return hub + np.array([-sweep * along**2, along * HANDLE_SPAN / 2, BOW * along**2])


def ring_offsets(sweep: float = SWEEP) -> np.ndarray:
    """(RING_COUNT, 3) places of the ring's spheres in the robot's frame [µm]."""
    angle = (np.arange(RING_COUNT) + 0.5) * 2 * np.pi / RING_COUNT
    x = np.full(RING_COUNT, 2 / 3 * sweep + RING_AHEAD)
    return np.stack([x, RING_RADIUS * np.cos(angle), RING_RADIUS * np.sin(angle)], axis=1)


def seat_distance(cell_radius: float) -> float:
    """Distance [µm] from the robot's origin to the centre of a cell of `cell_radius` [µm] that just fits its dish."""
    reach = (cell_radius + RING_SPHERE_RADIUS) ** 2 - RING_RADIUS**2
    return 2 / 3 * SWEEP + RING_AHEAD + float(np.sqrt(reach))


def five_element_robot(prim: str, position: Vec3, *, facing: int = 1, sweep: float = SWEEP) -> Body:
    """The robot as a body.

    Args:
        prim: Path of its prim.
        position: World place of its origin [µm].
        facing: 1 if the dish faces +X, −1 if it faces −X (half a turn about Z).
        sweep: How far the handles stand behind the hub [µm]; 0 puts the five elements in one plane.

    Returns:
        The body: five trapped elements and the ring.
    """
    radius = {"handle": HANDLE_RADIUS, "arm": ARM_RADIUS, "hub": HUB_RADIUS}
    elements = tuple(
        Sphere(
            prim=f"{prim}/{name}",
            offset=rounded(element_offset(name, sweep)),
            radius=radius[name.split("_")[0]],
            refractive_index=RESIST_INDEX,
            collides=name != "hub",
        )
        for name in ELEMENTS
    )
    ring = tuple(
        Sphere(
            prim=f"{prim}/ring_{i}",
            offset=rounded(offset),
            radius=RING_SPHERE_RADIUS,
            refractive_index=RESIST_INDEX,
            trapped=False,
        )
        for i, offset in enumerate(ring_offsets(sweep))
    )
    return Body(
        prim=prim,
        position=rounded(position),
        orientation=IDENTITY if facing > 0 else (0.0, 0.0, 1.0, 0.0),
        spheres=elements + ring,
        material=RESIST,
        warning_force=10.0,
    )


def add_robot(builder: SceneBuilder, robot: Body, *, color: Color) -> None:
    """Add `robot` and the rods that make it look like one piece."""
    builder.add(robot, color=color)
    offsets = [sphere.offset for sphere in robot.spheres]
    beam, ring = offsets[: len(ELEMENTS)], offsets[len(ELEMENTS) :]
    for i, (start, end) in enumerate(pairwise(beam)):
        builder.add_rod(robot.prim, f"beam_{i}", start, end, ARM_RADIUS, color=color)
    for i, start in enumerate(ring):
        builder.add_rod(robot.prim, f"rim_{i}", start, ring[(i + 1) % RING_COUNT], RING_SPHERE_RADIUS, color=color)
    for i in range(0, RING_COUNT, 2):
        builder.add_rod(robot.prim, f"strut_{i}", beam[2], ring[i], STRUT_RADIUS, color=color)


def element_position(robot: Body, element: str) -> np.ndarray:
    """(3,) world place [µm] of an element of a robot made by `five_element_robot`."""
    x, y, z = next(s.offset for s in robot.spheres if s.prim.endswith("/" + element))
    turn = 1.0 if robot.orientation == IDENTITY else -1.0
    return np.array(robot.position) + np.array([turn * x, turn * y, z])


def element_radius(element: str) -> float:
    """Radius [µm] of one of the held elements."""
    return HUB_RADIUS if element == "hub" else HANDLE_RADIUS


def trap_on(
    robot: Body,
    element: str,
    prim: str,
    *,
    power: float,
    shift: Vec3 = (0.0, 0.0, 0.0),
    path: Track | None = None,
    laws: tuple[TrapLaw, TrapLaw] = (trap_laws.RADIAL, trap_laws.AXIAL),
    hand: str = "none",
    speed_limit: float = float("inf"),
) -> Trap:
    """A trap that holds one element of a robot.

    Args:
        robot: The robot, at the place where it starts.
        element: One of `HELD_ELEMENTS`.
        prim: Path of the trap's prim.
        power: Power [mW].
        shift: Added to the place where the trap would hold the element at rest [µm]: the preload.
        path: Displacement from the start over time [µm], or None for a trap at rest.
        laws: Radial and axial law; by default the fitted ones.
        hand: Which hand moves the trap.
        speed_limit: Fastest the focus may move [µm/s].
    """
    radius = element_radius(element)
    equilibrium = trap_laws.equilibrium_of(radius)
    focus = element_position(robot, element) + np.array(shift) - np.array([0.0, 0.0, equilibrium])
    path = path or Track.constant((0.0, 0.0, 0.0))
    return Trap(
        prim=prim,
        position=Track(times=path.times, values=np.round(focus + path.values, 6) + 0.0),
        power=Track.constant(power),
        radial=laws[0],
        axial=laws[1],
        equilibrium=equilibrium,
        hand=hand,  # type: ignore[arg-type]
        speed_limit=speed_limit,
        holds=f"{robot.prim}/{element}",
    )


def traps_on(robot: Body, prefix: str, *, power: float, **options: object) -> list[Trap]:
    """The three traps of a robot: `<prefix>_<element>` on both handles and the hub; options as in `trap_on`."""
    return [trap_on(robot, e, f"{prefix}_{e}", power=power, **options) for e in HELD_ELEMENTS]  # type: ignore[arg-type]
