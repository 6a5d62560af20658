"""New things for a scene that is drawn, like those that it has already."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from otwarp.errors import InputError
from otwarp.laws import TrapLaw
from otwarp.scene import Body, Goal, Obstacle, Sphere, Track, Trap
from otwarp.scene.write.edit import StageEditor

KINDS = ("trap", "cell", "obstacle", "goal")
"""What is made here; `otwarp.view.new_pieces` makes robots and meshes."""
LAW, POWER = TrapLaw(stiffness=1.0, power=1.0), 5.0
"""Of a trap in a scene without any: a spring of 1 pN/µm per mW, and its power [mW]."""


def new_item(kind: str, editor: StageEditor, place: Sequence[float], size: float) -> Trap | Body | Obstacle | Goal:
    """A thing at a place, at a path that is free.

    A trap has the law, the power and the beam of the scene's first trap; a cell the material of its first cell; a goal
    is for the first cell and all robots, or for the first robot alone.

    Args:
        kind: One of `KINDS`.
        editor: The scene.
        place: Where [µm].
        size: Radius of a cell or a goal, half side of an obstacle, a cube [µm].

    Raises:
        InputError: A goal where there is one, or without a robot; a size that is not above 0.
    """
    scene, path = editor.scene, editor.free_path(kind)
    x, y, z = (round(float(v), 6) for v in place)
    if not size > 0.0:
        raise InputError(f"size = {size:g} µm: must be above 0")
    if kind == "trap":
        if not scene.traps:
            track, power = Track.constant((x, y, z)), Track.constant(POWER)
            return Trap(prim=path, position=track, power=power, model="harmonic", radial=LAW)
        first = scene.traps[0]
        power = Track.constant(first.power.at(0.0))
        return dataclasses.replace(
            first, prim=path, position=Track.constant((x, y, z)), power=power, holds=None, hand="none"
        )
    if kind == "cell":
        like = next((b for b in scene.bodies if b.kind == "cell"), None)
        if like is None:
            sphere = Sphere(prim=path, radius=size, trapped=False)
            return Body(prim=path, kind="cell", position=(x, y, z), spheres=(sphere,))
        sphere = dataclasses.replace(like.spheres[0], prim=path, radius=size)
        return dataclasses.replace(like, prim=path, instance=None, position=(x, y, z), spheres=(sphere,), forces={})
    if kind == "obstacle":
        still = Track.constant((0.0, 0.0, 0.0, 1.0))
        return Obstacle(
            prim=path, shape="box", position=Track.constant((x, y, z)), orientation=still, size=(size, size, size)
        )
    return _goal(editor, path, (x, y, z), size)


def _goal(editor: StageEditor, path: str, place: tuple[float, float, float], size: float) -> Goal:
    scene = editor.scene
    if scene.goal is not None:
        raise InputError(f"{scene.goal.prim}: is the goal already; must be one, which can be moved or deleted")
    whole = [b for b in scene.bodies if b.instance is None]
    robots = tuple(b.prim for b in whole if b.kind == "robot")
    if not robots:
        raise InputError("goal: nothing can bring it there; must be a scene with a robot")
    cell = next((b.prim for b in whole if b.kind == "cell"), robots[0])
    return Goal(
        prim=path,
        position=place,
        cell=cell,
        robots=robots if cell not in robots else (cell,),
        tolerance=size,
        lost_distance=3.0,
        cell_lost_distance=12.0,
        distance_warning=1.0,
    )
