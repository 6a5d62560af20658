"""Runs inside Blender's Python: what a USD file has become there, as JSON, and a picture of it."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path

import bpy  # type: ignore[import-not-found]

RECIPE = Path(__file__).parents[2] / "docs" / "recipes" / "blender.py"


def imported(file: str, recipe: object) -> dict[str, list]:
    """By a plain File ▸ Import: materials and display look of every shape."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.usd_import(filepath=file)
    meshes = [item for item in bpy.data.objects if item.type == "MESH"]
    return {m.name: [len(m.data.materials), [*(look := recipe.display_look(m.data))[0], look[1]]] for m in meshes}


def main() -> None:
    file, picture, camera, frames = sys.argv[1], sys.argv[2], sys.argv[3], json.loads(sys.argv[4])
    spec = importlib.util.spec_from_file_location("recipe", RECIPE)
    recipe = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(recipe)
    plain = imported(file, recipe)
    recipe.load(Path(file), camera)
    scene = bpy.context.scene
    said = {"fps": scene.render.fps, "frames": [scene.frame_start, scene.frame_end], "objects": {}, "places": {}}
    said["plain"] = plain
    for item in bpy.data.objects:
        if item.type == "MESH":
            (only,) = item.data.materials
            surface = only.node_tree.nodes["Principled BSDF"].inputs
            look = [*surface["Base Color"].default_value[:3], surface["Alpha"].default_value]
            said["objects"].setdefault(item.name.split(".")[0], []).append(look)
    for frame in frames:
        scene.frame_set(frame)
        said["places"][frame] = {item.name: list(item.matrix_world.translation) for item in bpy.data.objects}
    recipe.render(Path(picture), frame=frames[-1], size=(160, 90), samples=4)
    print("SAID " + json.dumps(said))


if __name__ == "__main__":
    main()
