"""Why and where trials ended: what came first, which trap let go first, where a body was then."""

from __future__ import annotations

from otwarp.errors import InputError
from otwarp.kernels.drivers import numbers
from otwarp.kernels.drivers.episodes import WorldFunction
from otwarp.scene import Scene
from otwarp.simulation import ends
from otwarp.studies.observables import Observable, OfScene, check_time

AXES = {"x": 0, "y": 1, "z": 2}


def first_lost() -> OfScene:
    """Which trap was the first to lose its sphere, by the names of their prims; a choice, with shares of all trials.

    `several` lost theirs in one time step.
    """

    def made(scene: Scene) -> Observable:
        """Of the traps that hold something."""
        names = _short([t.prim for t in scene.traps])
        return Observable(
            "first_lost", "choice", function=WorldFunction(numbers.first_lost, ()), choices=(*names, "several")
        )

    return OfScene(made)


def outcome() -> Observable:
    """Which of the study's ends came, or `none` by the horizon; a choice, with shares of all trials."""
    return Observable("outcome", "choice")


def left_behind(*, until: float) -> OfScene:
    """Whether the scene's cell has been lost by its two robots by `until` [s], as its goal says what that is."""
    by = check_time("until", until)

    def made(scene: Scene) -> Observable:
        """Of the goal's cell and robots."""
        cell, left, right, distance = _carried(scene)
        end = ends.left_behind(distance=distance, cell=cell, left=left, right=right)
        return Observable("left_behind", "probability", end=end, until=by)

    return OfScene(made)


def place(*, along: str, body: str | None = None) -> OfScene:
    """Where a body is at the end of a trial along x, y or z [µm].

    Args:
        along: `x`, `y` or `z`.
        body: Its prim; None: the cell of the scene's goal, or its only body.

    Raises:
        InputError: No such direction; a body that is none of the scene.
    """
    if along not in AXES:
        raise InputError(f"place has along = {along!r}; allowed: x, y, z")

    def made(scene: Scene) -> Observable:
        """Of a body of the scene."""
        names = [b.prim for b in scene.bodies]
        wanted = body or (scene.goal.cell if scene.goal is not None else names[0] if len(names) == 1 else None)
        if wanted not in names:
            raise InputError(f"place has body = {wanted!r}; allowed: {', '.join(names[:12])}")
        function = WorldFunction(numbers.place, (int, int))
        values = (float(names.index(wanted)), float(AXES[along]))
        return Observable(f"place_{along}", "number", function=function, values=values, unit="µm")

    return OfScene(made)


def _carried(scene: Scene) -> tuple[int, int, int, float]:
    """Indices of the goal's cell and of its two robots, and the distance at which it is lost [µm]."""
    goal = scene.goal
    if goal is None or len(goal.robots) != 2:
        count = "no goal" if goal is None else f"{len(goal.robots)} robots"
        raise InputError(
            f"{scene.file or scene.root}: left_behind: the scene has {count}; allowed: a goal with two robots"
        )
    names = [b.prim for b in scene.bodies]
    left, right = (names.index(robot) for robot in goal.robots)
    return names.index(goal.cell), left, right, goal.cell_lost_distance


def _short(prims: list[str]) -> tuple[str, ...]:
    """Last names of prims, or all of their paths where those would be alike."""
    last = [p.rsplit("/", 1)[-1] for p in prims]
    return tuple(last if len(set(last)) == len(last) else (p.strip("/").replace("/", "_") for p in prims))
