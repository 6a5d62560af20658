"""One thing by itself, before it is written: what can be said of it without the rest of its scene."""

from __future__ import annotations

from typing import Any, get_args

from otwarp.errors import InputError
from otwarp.scene.check.fields import check_fields
from otwarp.scene.check.numbers import check_numbers
from otwarp.scene.check.parts import check_bodies, check_obstacle, check_trap
from otwarp.scene.check.scene import check_flow
from otwarp.scene.description import Body, Camera, Flow, Goal, Medium, Obstacle, Trap
from otwarp.scene.vocabulary import CAMERA, GOAL

Item = Trap | Body | Obstacle | Flow | Camera | Goal


def check_item(where: str, item: Any, medium: Medium) -> None:
    """Refuse what is no item of a scene, or one that no file could say.

    Args:
        where: What errors name first.
        item: What was given.
        medium: Of the scene.

    Raises:
        InputError: One line.
    """
    if not isinstance(item, Item):
        allowed = ", ".join(kind.__name__ for kind in get_args(Item))
        raise InputError(f"{where}: item = {item!r} (of class {type(item).__name__}): must be one of {allowed}")
    if not isinstance(item.prim, str):
        raise InputError(f"{where}: {type(item).__name__}: prim = {item.prim!r}: must be the path of a prim")
    if isinstance(item, Trap):
        check_trap(where, item, medium)
    elif isinstance(item, Body):
        check_bodies(where, [item])
    elif isinstance(item, Obstacle):
        check_obstacle(where, item)
    elif isinstance(item, Flow):
        check_flow(where, item)
    elif isinstance(item, Camera):
        check_fields(where, item.prim, CAMERA, item)
    else:
        check_fields(where, item.prim, GOAL, item)
        check_numbers(where, item.prim, "position", item.position, (3,))
