"""Renders a scene or a recorded run of otwarp in Blender, or makes a .blend of it.

    make blender                                                     # once: Blender as a module, in .venv-blender
    .venv-blender/bin/python docs/recipes/blender.py out/cell_delivery/run.usda -o still.png --frame 300
    blender --background --python docs/recipes/blender.py -- out/cell_delivery/run.usda --blend run.blend

Needs nothing of otwarp. Blender 5.0 reads spheres, cylinders, cones … of a USD file but not their materials: these are
made here of the display colours. (`otwarp export RUN --meshes -o run.usdc` writes a file that needs no recipe.)
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

import bpy  # type: ignore[import-not-found]


def load(file: Path, camera: str | None = None) -> None:
    """Import a USD file into an empty Blender, with materials, frame rate and camera.

    Args:
        file: USD.
        camera: Its name; without one `view`, else any.

    Raises:
        SystemExit: No such camera.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    # one unit is a micrometre, as in the file: Blender's cameras see nothing that is nearer than a millionth
    bpy.ops.wm.usd_import(filepath=str(file), apply_unit_conversion_scale=False)
    for item in bpy.data.objects:
        if item.type == "MESH" and not any(item.data.materials):
            item.data.materials.append(material(*display_look(item.data)))
    scene = bpy.context.scene
    if rate := frame_rate(file):
        scene.render.fps = round(rate)
    cameras = {item.name: item for item in bpy.data.objects if item.type == "CAMERA"}
    if camera is not None and camera not in cameras:
        raise SystemExit(f"--camera is {camera}; allowed: {', '.join(cameras) or 'none, there is no camera'}")
    scene.camera = cameras.get(camera or "view") or next(iter(cameras.values()), None)


def display_look(mesh: bpy.types.Mesh) -> tuple[tuple[float, ...], float]:
    """Display colour (linear) and opacity of a shape."""
    color, opacity = (mesh.attributes.get(name) for name in ("displayColor", "displayOpacity"))
    rgb = tuple(color.data[0].color[:3]) if color and len(color.data) else (0.5, 0.5, 0.5)
    return rgb, float(opacity.data[0].value) if opacity and len(opacity.data) else 1.0


def material(color: tuple[float, ...], opacity: float) -> bpy.types.Material:
    """A material of this colour and opacity; equal ones are one."""
    name = "Display_" + "".join(f"{round(255 * x):02x}" for x in (*color, opacity))
    if name in bpy.data.materials:
        return bpy.data.materials[name]
    made = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0):  # later ones always have nodes
        made.use_nodes = True
    surface = made.node_tree.nodes["Principled BSDF"].inputs
    surface["Base Color"].default_value = (*color, 1.0)
    surface["Alpha"].default_value = opacity
    surface["Roughness"].default_value = 0.45
    made.surface_render_method = "DITHERED" if opacity == 1.0 else "BLENDED"
    return made


def frame_rate(file: Path) -> float | None:
    """Frames per second, which Blender does not take from the file; None for a binary file."""
    found = re.search(rb"^ *framesPerSecond = (\S+)", file.read_bytes()[:4000], re.MULTILINE)
    return float(found[1]) if found else None


def render(out: Path, *, frame: int, size: tuple[int, int], samples: int) -> None:
    """Render one frame with Cycles on the CPU, denoised."""
    scene = bpy.context.scene
    scene.frame_set(frame)
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples, scene.cycles.use_denoising = "CPU", samples, True
    scene.cycles.transparent_max_bounces = 32
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.filepath = str(out.resolve())
    bpy.ops.render.render(write_still=True)


def main() -> None:
    """What the command line says."""
    given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    parser = argparse.ArgumentParser(prog="blender.py", description="A scene or a run of otwarp in Blender.")
    parser.add_argument("file", type=Path, help="run.usda of a run, a scene, or what `otwarp export` wrote")
    parser.add_argument("-o", "--out", type=Path, help="PNG to render")
    parser.add_argument("--blend", type=Path, help="Blender file to write")
    parser.add_argument("--frame", type=int, default=0)
    parser.add_argument("--camera")
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--samples", type=int, default=64)
    options = parser.parse_args(given)
    if not options.file.is_file():
        raise SystemExit(f"{options.file}: there is no such file; allowed: a USD file")
    load(options.file, options.camera)
    if options.blend:
        bpy.ops.wm.save_as_mainfile(filepath=str(options.blend.resolve()))
    if options.out:
        width, height = (int(n) for n in options.size.split("x"))
        render(options.out, frame=options.frame, size=(width, height), samples=options.samples)


if __name__ == "__main__":
    main()
