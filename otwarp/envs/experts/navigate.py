"""Scripts for Navigate: straight to the goal, and the shortest way round all obstacles as they are now."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra

from otwarp.envs.experts.policies import Seen, planar, unit
from otwarp.scene import Obstacle, Scene

SPEED_LIMIT = 60.0
"""What 1 stands for in an action [µm/s]."""


class StraightLine:
    """Straight to the goal, whatever is in the way.

    Args:
        speed: Of the trap [µm/s].
    """

    def __init__(self, speed: float = 40.0):
        self.speed = speed

    def __call__(self, seen: Seen, fresh: np.ndarray) -> np.ndarray:
        """(N, 2) actions."""
        return self.speed / SPEED_LIMIT * unit(planar(seen, "goal_offset"))


class ShortestPath:
    """The shortest way on a grid that keeps off all obstacles, planned anew in each period: what A* finds.

    Boxes move on while the robot gets there: where they will be within `AHEAD` is closed, too. Ways are those of
    Dijkstra's algorithm from the goal, which are those of A*.

    Args:
        speed: Of the trap [µm/s].
        margin: Kept between robot and obstacles [µm].
        spacing: Of the grid [µm].
    """

    AHEAD = (0.0, 0.15, 0.3)
    """Times at which boxes are looked at [s]."""
    LOOK = 4
    """Nodes along the way to aim at."""

    def __init__(self, speed: float = 40.0, margin: float = 1.0, spacing: float = 1.5):
        from otwarp.envs.scenes import load

        scene = load("navigate")
        radius = scene.bodies[0].spheres[0].radius
        self.speed, self.keep = speed, radius + margin
        self.boxes = [o for o in scene.obstacles if o.position.animated]
        low, high = _inside(scene)
        axes = [np.arange(a, b + 1e-9, spacing) for a, b in zip(low, high, strict=True)]
        x, y = np.meshgrid(*axes, indexing="ij")
        self.nodes = np.stack([x.ravel(), y.ravel()], axis=1)
        still = [o for o in scene.obstacles if not o.position.animated and o.shape in ("cylinder", "box")]
        distance = np.min([_distance(o, self.nodes - o.position.at(0.0)[:2]) for o in still], axis=0)
        self.free = distance > self.keep
        self.edges = _edges(x.shape, spacing)

    def __call__(self, seen: Seen, fresh: np.ndarray) -> np.ndarray:
        """(N, 2) actions."""
        place, goal = planar(seen, "body_position"), planar(seen, "goal_offset")
        ways = np.stack([self._way(seen, n, place[n], place[n] + goal[n]) for n in range(len(fresh))])
        return self.speed / SPEED_LIMIT * unit(ways)

    def _way(self, seen: Seen, world: int, place: np.ndarray, goal: np.ndarray) -> np.ndarray:
        """(2) way to take from a place [µm]."""
        free = self.free.copy()
        for box in self.boxes:
            name = box.prim.rsplit("/", 1)[-1]
            middle = place + np.array([seen[f"{name}.x"][world], seen[f"{name}.y"][world]])
            velocity = np.array([seen[f"{name}_velocity.x"][world], seen[f"{name}_velocity.y"][world]])
            for later in self.AHEAD:
                free &= _distance(box, self.nodes - middle - later * velocity) > self.keep
        start, end = (_nearest(self.nodes, free, point) for point in (place, goal))
        a, b, length = self.edges
        open_ = free[a] & free[b]
        graph = coo_matrix((length[open_], (a[open_], b[open_])), shape=(len(free), len(free)))
        _, before = dijkstra(csr_matrix(graph), directed=False, indices=end, return_predecessors=True)
        node = start
        for _ in range(self.LOOK):
            node = before[node] if before[node] >= 0 else node
        return (goal if node == end else self.nodes[node]) - place


def _inside(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the space between the walls [µm]."""
    walls = [o.position.at(0.0)[:2] for o in scene.obstacles if "/wall_" in o.prim]
    return np.min(walls, axis=0), np.max(walls, axis=0)


def _distance(obstacle: Obstacle, away: np.ndarray) -> np.ndarray:
    """(n) distance of points from an upright obstacle, from their ways (n, 2) from its middle [µm]."""
    if obstacle.shape == "cylinder":
        return np.linalg.norm(away, axis=1) - obstacle.size[0]
    beyond = np.abs(away) - np.array(obstacle.size[:2])
    return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)


def _edges(shape: tuple[int, ...], spacing: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ends and lengths [µm] of the edges between each node of a grid and its eight neighbours."""
    index = np.arange(shape[0] * shape[1]).reshape(shape)
    pairs = [
        (index[:-1], index[1:], 1.0),
        (index[:, :-1], index[:, 1:], 1.0),
        (index[:-1, :-1], index[1:, 1:], np.sqrt(2.0)),
        (index[:-1, 1:], index[1:, :-1], np.sqrt(2.0)),
    ]
    ends = [np.concatenate([pair[n].ravel() for pair in pairs]) for n in (0, 1)]
    return ends[0], ends[1], np.concatenate([np.full(a.size, spacing * length) for a, _, length in pairs])


def _nearest(nodes: np.ndarray, free: np.ndarray, point: np.ndarray) -> int:
    """The free node nearest to a point."""
    return int(np.argmin(np.where(free, np.sum((nodes - point) ** 2, axis=1), np.inf)))
