"""The shipped scenes, as tasks step them."""

from __future__ import annotations

from dataclasses import replace

from otwarp.scene import Scene
from otwarp.shipped import shipped


def load(name: str) -> Scene:
    """A shipped scene."""
    return Scene.load(shipped("scenes", name))


def without_contact(scene: Scene) -> Scene:
    """The same with bodies that touch nothing: for tasks that end when they would, which is judged by distances."""
    bodies = [replace(b, spheres=tuple(replace(s, collides=False) for s in b.spheres)) for b in scene.bodies]
    return replace(scene, bodies=tuple(bodies), judged=False)
