"""`Roles`: which of a scene's traps and bodies the paper's topics mean, and what they say of a live frame."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.haptics.core import Vec3
from otwarp.haptics.core.config import PAIRINGS
from otwarp.ros.contract import OBSTACLE_TOPICS, Pose, Quat, TopicState
from otwarp.ros.motion import centroid
from otwarp.scene import Obstacle, Scene, Trap
from otwarp.scene.obstacle_shapes import SHAPES
from otwarp.scene.transforms import conjugate, rotate
from otwarp.teleop import HANDS, LiveFrame, vec3


@dataclass(frozen=True, eq=False)
class Roles:
    """Two groups of traps, the robot of each, a cell, moving obstacles.

    Attributes:
        scene: The scene.
        groups: Trap indices of the first and second group.
        robots: Body index of each group's robot.
        holds: Of each group, those traps that hold a sphere of its robot.
        pushed: From the mean focus of these traps to the mean of the places where light holds their spheres [µm].
        centres: Mean of these spheres in the robot's frame [µm].
        cell: Body index of the cell, or None.
        obstacles: Those that move, four at most.
    """

    scene: Scene
    groups: tuple[tuple[int, ...], tuple[int, ...]]
    robots: tuple[int, int]
    holds: tuple[tuple[int, ...], tuple[int, ...]]
    pushed: tuple[Vec3, Vec3]
    centres: tuple[Vec3, Vec3]
    cell: int | None
    obstacles: tuple[Obstacle, ...]

    @classmethod
    def of(cls, scene: Scene, held: Sequence[tuple[int, int]], pairing: str = "release") -> Roles:
        """Find them.

        Args:
            scene: As it is simulated.
            held: Per trap the body of the sphere that it holds, -1 for none, and the sphere's index (`Model.held`).
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
        holds = [tuple(t for t in group if held[t][0] == b) for group, b in zip(groups, robots, strict=True)]
        pushed = [centroid([_pushed(scene.traps[t]) for t in some]) for some in holds]
        centres = [centroid([scene.bodies[held[t][0]].spheres[held[t][1]].offset for t in some]) for some in holds]
        moving = tuple(o for o in scene.obstacles if o.position.animated or o.orientation.animated)
        cell = _cell(scene, (robots[0], robots[1]))
        return cls(
            scene=scene,
            groups=(groups[0], groups[1]),
            robots=(robots[0], robots[1]),
            holds=(holds[0], holds[1]),
            pushed=(pushed[0], pushed[1]),
            centres=(centres[0], centres[1]),
            cell=cell,
            obstacles=moving[: len(OBSTACLE_TOPICS)],
        )

    def state(self, live: LiveFrame) -> TopicState:
        """What the topics say of a frame; an obstacle is hit as hard as anything presses on what touches it.

        A robot is where the mean of its held spheres is, and a trap where its group holds them, so that the one lies on
        the other but for what pulls: a force node takes their difference for the force.
        """
        frame, cell = live.frame, self.cell
        place, turn, load = frame.position[0], frame.orientation[0], frame.contact_load[0]
        first, second = (tuple(vec3(frame.trap_position[0, t]) for t in group) for group in self.groups)
        rests = [
            vec3(frame.trap_position[0, list(some)].mean(axis=0) + pushed)
            for some, pushed in zip(self.holds, self.pushed, strict=True)
        ]
        one, two = (
            (vec3(place[b] + rotate(turn[b], np.array(centre))), _quat(turn[b]))
            for b, centre in zip(self.robots, self.centres, strict=True)
        )
        obstacles = tuple(
            (vec3(o.position.at(frame.time)), _quat(o.orientation.at(frame.time))) for o in self.obstacles
        )
        hits = tuple(self._hit(o, at, place, turn, load) for o, at in zip(self.obstacles, obstacles, strict=True))
        return TopicState(
            time=frame.time,
            traps=(first, second),
            rests=(rests[0], rests[1]),
            robots=(one, two),
            cell=None if cell is None else vec3(place[cell]),
            obstacles=obstacles,
            contact_force=0.0 if cell is None else float(load[cell]),
            cell_lost=self._cell_lost(place),
            collision=any(hit for hit, _ in hits),
            collision_force=max((force for hit, force in hits if hit), default=0.0),
            hits=hits,
        )

    def _cell_lost(self, place: np.ndarray) -> bool:
        """Whether the cell is farther from the robots' midpoint than the scene's goal allows."""
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
            gaps = surface_distance(obstacle, pose, centres) - np.array([s.radius for s in spheres])
            if np.any(gaps <= 0.0):
                hit, force = True, max(force, float(load[b]))
        return hit, force


def _pushed(trap: Trap) -> Vec3:
    """From a focus to where it holds a sphere [µm]: light pushes along the beam until the gradient pulls back."""
    return vec3(rotate(np.array(trap.orientation), np.array([0.0, 0.0, trap.equilibrium])))


def surface_distance(obstacle: Obstacle, pose: Pose, points: np.ndarray) -> np.ndarray:
    """Signed distances (n,) of points from an obstacle's surface, negative inside [µm]; inf for a mesh.

    Args:
        obstacle: Its shape and size.
        pose: Where it is now.
        points: (n, 3) [µm].
    """
    place, turn = pose
    p = rotate(conjugate(np.array(turn)), points - np.array(place))
    distance = SHAPES[obstacle.shape].distance
    return np.full(len(p), np.inf) if distance is None else distance(p, np.array(obstacle.size))


def _cell(scene: Scene, robots: tuple[int, int]) -> int | None:
    """The goal's cell, else the one nearest to the midpoint of the robots at the start."""
    cells = [n for n, body in enumerate(scene.bodies) if body.kind == "cell"]
    if scene.goal is not None:
        named = [n for n in cells if scene.bodies[n].name == scene.goal.cell]
        if named:
            return named[0]
    middle = np.mean([scene.bodies[b].position for b in robots], axis=0)
    return min(cells, key=lambda n: float(np.linalg.norm(middle - scene.bodies[n].position)), default=None)


def _quat(values: np.ndarray) -> Quat:
    x, y, z, w = (float(v) for v in values)
    return x, y, z, w
