"""`Roles`: a scene as the paper's topics know it: two groups of traps, their robots, a cell, moving obstacles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.haptics.core.presets import PAIRINGS
from otwarp.haptics.core.types import Vec3
from otwarp.ros.touching import gap
from otwarp.scene.description import Obstacle, Scene
from otwarp.scene.transforms import rotate
from otwarp.teleop.core.frame import HANDS, LiveFrame

Pose = tuple[Vec3, tuple[float, float, float, float]]
"""Position [µm] and orientation x, y, z, w."""
MOST_OBSTACLES = 4
"""The contract has `/DynaOb01` to `/DynaOb04`."""


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class TopicState:
    """A moment of the twin.

    Attributes:
        time: Simulated [s].
        traps: Foci of each group [µm].
        robots: Pose of each group's robot.
        cell: Its centre [µm], None without one.
        obstacles: Poses of those that move.
        cell_force: Sum of the normal forces on the cell [pN].
        cell_lost: Whether it is farther from the robots' midpoint than the scene's goal allows.
        hits: For each obstacle whether a robot or the cell touches it, and the load on what touches it [pN].
    """

    time: float
    traps: tuple[tuple[Vec3, ...], tuple[Vec3, ...]]
    robots: tuple[Pose, Pose]
    cell: Vec3 | None
    obstacles: tuple[Pose, ...]
    cell_force: float
    cell_lost: bool
    hits: tuple[tuple[bool, float], ...]

    @property
    def centres(self) -> tuple[Vec3, Vec3]:
        """Mean focus of each group [µm]."""
        first, second = (_vector(np.mean(group, axis=0)) for group in self.traps)
        return first, second


@dataclass(frozen=True, eq=False)
class Roles:
    """Which of a scene's traps and bodies the topics mean.

    Attributes:
        scene: The scene.
        groups: Trap indices of the first and second group.
        robots: Body index of each group's robot.
        cell: Body index of the cell, or None.
        obstacles: Those that move, four at most.
    """

    scene: Scene
    groups: tuple[tuple[int, ...], tuple[int, ...]]
    robots: tuple[int, int]
    cell: int | None
    obstacles: tuple[Obstacle, ...]

    @classmethod
    def of(cls, scene: Scene, held: Sequence[tuple[int, int]], pairing: str = "release") -> Roles:
        """Find them.

        Args:
            scene: As it is simulated.
            held: Per trap the body that it holds (`Model.held`), -1 for none.
            pairing: Key of `PAIRINGS`: which hand has the first group.

        Raises:
            InputError: A hand without a trap, or a group that holds nothing.
        """
        where = scene.file or scene.root
        groups: list[tuple[int, ...]] = [(), ()]
        robots = [-1, -1]
        for hand in HANDS:
            traps = tuple(n for n, trap in enumerate(scene.traps) if trap.hand == hand)
            bodies = Counter(held[n][0] for n in traps if held[n][0] >= 0)
            if not bodies:
                lacks = "holds a sphere" if traps else f"has ot:trap:hand = {hand!r}"
                raise InputError(f"{where}: no trap of the {hand} hand {lacks}; allowed: two hands that hold a robot")
            n = PAIRINGS[pairing][hand].group  # type: ignore[index]
            groups[n], robots[n] = traps, bodies.most_common(1)[0][0]
        moving = tuple(o for o in scene.obstacles if o.position.animated or o.orientation.animated)
        cell = _cell(scene, (robots[0], robots[1]))
        return cls(scene, (groups[0], groups[1]), (robots[0], robots[1]), cell, moving[:MOST_OBSTACLES])

    def now(self, live: LiveFrame) -> TopicState:
        """What the topics say of a frame."""
        frame = live.frame
        place, turn, load = frame.position[0], frame.orientation[0], frame.contact_load[0]
        foci = frame.trap_position[0]
        first, second = (tuple(_vector(foci[t]) for t in group) for group in self.groups)
        one, two = ((_vector(place[b]), _quat(turn[b])) for b in self.robots)
        obstacles = tuple(
            (_vector(o.position.at(frame.time)), _quat(o.orientation.at(frame.time))) for o in self.obstacles
        )
        cell = self.cell
        return TopicState(
            time=frame.time,
            traps=(first, second),
            robots=(one, two),
            cell=None if cell is None else _vector(place[cell]),
            obstacles=obstacles,
            cell_force=0.0 if cell is None else float(load[cell]),
            cell_lost=self._cell_lost(place),
            hits=tuple(
                self._hit(o, pose, place, turn, load) for o, pose in zip(self.obstacles, obstacles, strict=True)
            ),
        )

    def _cell_lost(self, place: np.ndarray) -> bool:
        goal = self.scene.goal
        if self.cell is None or goal is None:
            return False
        middle = place[list(self.robots)].mean(axis=0)
        return bool(np.linalg.norm(place[self.cell] - middle) > goal.cell_lost_distance)

    def _hit(
        self, obstacle: Obstacle, pose: Pose, place: np.ndarray, turn: np.ndarray, load: np.ndarray
    ) -> tuple[bool, float]:
        """Whether a robot or the cell touches an obstacle; the load is that on the body, by whatever touches it."""
        hit, force = False, 0.0
        for b in (*self.robots, *(() if self.cell is None else (self.cell,))):
            spheres = [s for s in self.scene.bodies[b].spheres if s.collides]
            centres = place[b] + rotate(turn[b], np.array([s.offset for s in spheres]).reshape(-1, 3))
            gaps = gap(obstacle, pose, centres) - np.array([s.radius for s in spheres])
            if np.any(gaps <= 0.0):
                hit, force = True, max(force, float(load[b]))
        return hit, force


def _cell(scene: Scene, robots: tuple[int, int]) -> int | None:
    """The goal's cell, else the one nearest to the midpoint of the robots at the start."""
    cells = [n for n, body in enumerate(scene.bodies) if body.kind == "cell"]
    if scene.goal is not None:
        named = [n for n in cells if scene.bodies[n].name == scene.goal.cell]
        if named:
            return named[0]
    middle = np.mean([scene.bodies[b].position for b in robots], axis=0)
    return min(cells, key=lambda n: float(np.linalg.norm(middle - scene.bodies[n].position)), default=None)


def _vector(values: np.ndarray) -> Vec3:
    x, y, z = (float(v) for v in values)
    return x, y, z


def _quat(values: np.ndarray) -> tuple[float, float, float, float]:
    x, y, z, w = (float(v) for v in values)
    return x, y, z, w
