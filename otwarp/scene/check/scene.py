"""One judge of descriptions: the reader asks it of what files say, and the model of what was built in Python."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from otwarp.errors import nearest
from otwarp.scene import vocabulary
from otwarp.scene.check.fields import check_fields, is_number
from otwarp.scene.check.inlet import check_inlet
from otwarp.scene.check.numbers import check_numbers, check_places, check_turns
from otwarp.scene.check.overlap import INSIDE, check_overlaps
from otwarp.scene.check.parts import check_bodies, check_obstacle, check_trap
from otwarp.scene.check.period import check_period
from otwarp.scene.description import Body, Camera, Flow, Goal, Medium, Obstacle, Settings, Trap
from otwarp.scene.flow_grid import FlowGrid
from otwarp.scene.flow_profile import PROFILES
from otwarp.scene.vocabulary.values import bad

INFINITY = float("inf")

DELIVERED = "one prim with OtCellAPI, or the only robot of ot:goal:robots"
"""What a goal may be of."""


def check_scene(
    where: str,
    *,
    root: str,
    medium: Medium,
    settings: Settings,
    traps: Sequence[Trap],
    bodies: Sequence[Body],
    obstacles: Sequence[Obstacle],
    flow: Flow | None,
    camera: Camera | None,
    goal: Goal | None,
    overlap: float = INSIDE,
) -> None:
    """Refuse what cannot be simulated: wrong types, values out of range, parts that do not go together.

    Args:
        where: What errors name first: a file, or `Scene`.
        root: Path of the default prim.
        overlap: Overlap at the start that is allowed, relative to the smaller radius: files may say little of it,
            descriptions may start pressed together.

    The other arguments are fields of `Scene`.

    Raises:
        InputError: One line that names prim, attribute, value and what is allowed.
    """
    _check_classes(where, locals())
    check_settings(where, root, medium, settings)
    check_bodies(where, bodies)
    for trap in traps:
        check_trap(where, trap, medium)
    for obstacle in obstacles:
        check_obstacle(where, obstacle)
    check_names(where, traps, bodies, obstacles)
    check_holds(where, traps, bodies)
    if flow is not None:
        check_flow(where, flow)
    check_period(where, root, settings, bodies, obstacles, flow)
    check_inlet(where, root, settings, bodies)
    check_overlaps(where, bodies, obstacles, overlap, settings.period)
    if camera is not None:
        check_fields(where, camera.prim, vocabulary.CAMERA, camera)
    if goal is not None:
        _check_goal(where, goal, bodies)


def check_settings(where: str, root: str, medium: Medium, settings: Settings) -> None:
    """Refuse a liquid or settings that no file could say.

    Raises:
        InputError: One line.
    """
    check_fields(where, root, vocabulary.SCENE, medium=medium, settings=settings)
    for name in ("duration", "frames_per_second"):
        value = getattr(settings, name)
        if not is_number(value) or not 0.0 < value < INFINITY:
            raise bad(where, root, name, repr(value), "in (0, inf)")


_CLASSES: dict[str, type] = {
    "medium": Medium,
    "settings": Settings,
    "traps": Trap,
    "bodies": Body,
    "obstacles": Obstacle,
    "flow": Flow,
    "camera": Camera,
    "goal": Goal,
}


def _check_classes(where: str, fields: dict[str, Any]) -> None:
    for name, kind in _CLASSES.items():
        several = name in ("traps", "bodies", "obstacles")
        items = fields[name]
        if several and not isinstance(items, Sequence):
            raise bad(where, fields["root"], name, repr(items)[:80], f"a tuple of {kind.__name__}")
        for item in items if several else [] if items is None and name in ("flow", "camera", "goal") else [items]:
            if not isinstance(item, kind):
                raise bad(where, fields["root"], name, repr(item)[:80], f"of class {kind.__name__}")


def check_names(where: str, traps: Sequence[Trap], bodies: Sequence[Body], obstacles: Sequence[Obstacle]) -> None:
    """Refuse two parts of one name: by it recordings, topics and messages tell them apart."""
    for kind, names in (
        ("traps", [trap.prim for trap in traps]),
        ("bodies", [body.name for body in bodies]),
        ("obstacles", [obstacle.prim for obstacle in obstacles]),
    ):
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise bad(where, twice, "prim", f"{names.count(twice)} {kind}", "the path of one of them")


def check_holds(where: str, traps: Sequence[Trap], bodies: Sequence[Body]) -> None:
    """Refuse a trap whose `holds` does not name a sphere that traps act on.

    Raises:
        InputError: One line.
    """
    spheres = {sphere.prim for body in bodies if body.instance is None for sphere in body.spheres if sphere.trapped}
    for trap in traps:
        if trap.holds is not None and trap.holds not in spheres:
            allowed = f"a sphere of a body that traps act on{nearest(str(trap.holds), sorted(spheres))}"
            raise bad(where, trap.prim, "ot:trap:holds", trap.holds, allowed)


def check_flow(where: str, flow: Flow) -> None:
    """Refuse a flow that no file could say.

    Raises:
        InputError: One line.
    """
    check_fields(where, flow.prim, vocabulary.FLOW, flow)
    check_places(where, [flow.prim], "origin", check_numbers(where, flow.prim, "origin", flow.origin, (3,))[None])
    turn = check_numbers(where, flow.prim, "orientation", flow.orientation, (4,))
    check_turns(where, [flow.prim], "orientation", turn[None])
    for row in vocabulary.FLOW.attributes:
        # negative is out of the table's range
        if row.field in PROFILES[flow.kind].lengths and getattr(flow, row.field) == 0.0:
            raise bad(where, flow.prim, row.name, getattr(flow, row.field), f"in (0, inf) m for {flow.kind}")
    if PROFILES[flow.kind].strength is None and not isinstance(flow.field, FlowGrid):
        raise bad(
            where, flow.prim, "ot:flow:file", flow.file or "(empty)", f"a file with a velocity field for {flow.kind}"
        )


def _check_goal(where: str, goal: Goal, bodies: Sequence[Body]) -> None:
    check_fields(where, goal.prim, vocabulary.GOAL, goal)
    check_places(where, [goal.prim], "position", check_numbers(where, goal.prim, "position", goal.position, (3,))[None])
    cells = {body.prim for body in bodies if body.kind == "cell" and body.instance is None}
    robots = {body.prim for body in bodies if body.kind == "robot"}
    if goal.cell not in cells and (goal.cell not in robots or goal.robots != (goal.cell,)):
        raise bad(where, goal.prim, "ot:goal:cell", goal.cell or "(no target)", DELIVERED)
    strangers = [path for path in goal.robots if path not in robots]
    if strangers or not goal.robots:
        shown = ", ".join(strangers) or "(no target)"
        raise bad(where, goal.prim, "ot:goal:robots", shown, "prims with OtBodyAPI")
