"""What a picture of a scene's file does not show as it is: scenes may be changed in Python, where nothing is drawn."""

from __future__ import annotations

import dataclasses
from typing import Any

from otwarp.scene.read.variations import Variations
from otwarp.scene.scene import Scene


def unlike_file(scene: Scene) -> str:
    """A sentence on what looks otherwise in the scene's file, with the values of `overrides`; empty if nothing does.

    Shapes of bodies and obstacles, and places of obstacles; bodies and traps are drawn where they are.

    Raises:
        InputError: The file no longer opens.
    """
    assert scene.file is not None
    there = _looks(Variations(scene.file).scene(scene.overrides))
    others = sorted({key[0] for key, look in _looks(scene).items() if look != there.get(key, look)})
    if not others:
        return ""
    named = ", ".join(others[:3]) + (", …" if len(others) > 3 else "")
    return f"{named} shown as in {scene.file}: what was changed in Python says nothing of looks"


def _looks(scene: Scene) -> dict[tuple[str, int | None], Any]:
    """What is seen of bodies and obstacles, but for where bodies are, by path and instance."""
    solids = {
        (body.prim, body.instance): (
            [(s.prim, *s.offset, s.radius) for s in body.spheres],
            [(r.prim, *r.start, *r.end, r.radius) for r in body.rods],
        )
        for body in scene.bodies
    }
    return solids | {(o.prim, None): dataclasses.replace(o, hydrodynamic=False) for o in scene.obstacles}
