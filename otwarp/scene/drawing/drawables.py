"""Read what is visible in a USD stage at one time code: geometry, camera and lights, in µm."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom

from otwarp.errors import InputError
from otwarp.scene.drawing.draw_list import EMPTY, PLANE, Drawables, bounds
from otwarp.scene.drawing.shapes import Batch
from otwarp.scene.drawing.view import read_lights
from otwarp.scene.drawing.walk import Walk, middle
from otwarp.scene.read.diagnostics import reading
from otwarp.scene.read.source import open_stage


def _assemble(walk: Walk, batches: list[Batch]) -> dict[str, np.ndarray]:
    counts = [len(batch.transform) for batch in batches]
    placed = [walk.in_micrometres(batch) for batch in batches]
    transform = np.concatenate([np.zeros((0, 4, 4)), *(matrices for matrices, _ in placed)])

    def spread(name: str, width: tuple[int, ...]) -> np.ndarray:
        values = [np.broadcast_to(getattr(b.look, name), (n, *width)) for b, n in zip(batches, counts, strict=True)]
        return np.concatenate(values or [np.zeros((0, *width))])

    # A solid squashed flat or turned into a point has no inside: nothing to draw.
    solid = np.abs(np.linalg.det(transform[:, :3, :3])) > 1e-18
    arrays = {
        "kind": np.repeat(np.array([b.kind for b in batches], dtype=np.int32), counts),
        "transform": transform,
        "size": np.concatenate([np.zeros((0, 2)), *(size for _, size in placed)]),
        "colour": spread("colour", (3,)),
        "opacity": spread("opacity", ()),
        "roughness": spread("roughness", ()),
        "beam": np.repeat(np.array([b.beam for b in batches], dtype=bool), counts),
        "mesh": np.repeat(np.array([b.mesh for b in batches], dtype=np.int32), counts),
    }
    return {name: values[solid & np.isfinite(transform).all(axis=(1, 2))] for name, values in arrays.items()}


def has_purpose(stage: Usd.Stage, purpose: str) -> bool:
    """Whether anything on a stage has a UsdGeom purpose, such as `guide`, at whatever time and visible or not."""
    shapes = (UsdGeom.Imageable(prim) for prim in stage.Traverse())
    return any(shape and shape.ComputePurpose() == purpose for shape in shapes)


def read_drawables(
    stage_or_path: Usd.Stage | str | Path,
    time_code: float | None = None,
    *,
    camera: str | None = None,
    purposes: tuple[str, ...] = ("default", "render"),
) -> Drawables:
    """Read everything visible at `time_code`.

    Args:
        stage_or_path: An open stage, or its file.
        time_code: Time code; None reads default values and, where there are none, the first sample.
        camera: Path or name of the camera; without it the stage's first camera, or one that frames the scene.
        purposes: UsdGeom purposes drawn; add `guide` for helpers such as force arrows.

    Returns:
        Arrays in µm, whatever the stage's `metersPerUnit`.

    Raises:
        InputError: The file is missing, not USD or not whole, `metersPerUnit` is not positive, the camera is
            unknown or has no field of view.
    """
    stage: Usd.Stage = open_stage(Path(stage_or_path)) if isinstance(stage_or_path, str | Path) else stage_or_path
    with reading(stage.GetRootLayer().GetDisplayName()):
        return _drawables(stage, time_code, camera, purposes)


def _drawables(stage: Usd.Stage, time_code: float | None, camera: str | None, purposes: tuple[str, ...]) -> Drawables:
    metres = UsdGeom.GetStageMetersPerUnit(stage)
    if not metres > 0.0:
        raise InputError(f"{stage.GetRootLayer().GetDisplayName()}: metersPerUnit = {metres:g}, allowed (0, inf)")
    walk = Walk(stage, Usd.TimeCode.EarliestTime() if time_code is None else Usd.TimeCode(time_code), purposes)
    arrays = _assemble(walk, walk.collect(stage.GetPseudoRoot()))
    meshes = tuple(walk.shapes.meshes)
    lower, upper = bounds(arrays["kind"], arrays["transform"], arrays["size"], arrays["mesh"], meshes)
    # Frame the things, not the light or the ground; those only where there is nothing else.
    finite = np.isfinite(lower).all(axis=1)
    things = finite & ~arrays["beam"] & (arrays["kind"] != PLANE)
    framed = things if things.any() else finite
    lower, upper = (lower[framed], upper[framed]) if framed.any() else EMPTY
    return Drawables(
        **arrays,
        meshes=meshes,
        view=walk.view(camera, lower, upper),
        lights=read_lights(walk.lights, walk.scale, middle(lower, upper), walk.values),
        up=walk.up,
        time=0.0 if time_code is None else time_code / stage.GetTimeCodesPerSecond(),
    )
