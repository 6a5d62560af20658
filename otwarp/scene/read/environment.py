"""Reads what surrounds the bodies: medium and settings, flow, camera, goal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom

from otwarp.errors import InputError
from otwarp.scene import vocabulary
from otwarp.scene.check.scene import DELIVERED
from otwarp.scene.description import Camera, Flow, Goal, Medium, Settings
from otwarp.scene.read.attributes import part, read_values
from otwarp.scene.read.flow_file import read_flow_grid
from otwarp.scene.read.lenses import check_lens
from otwarp.scene.read.source import METRES, Source, quat, vec3
from otwarp.scene.transforms import conjugate, rotate

_UNSCALED = 1e-3
"""Relative difference of a scale from 1 that nobody means: single precision leaves 1e-6 of a rotation."""


def read_medium(source: Source, root: Usd.Prim) -> Medium:
    """The liquid, from OtSceneAPI on the default prim."""
    return Medium(**part(read_values(source.file, root, vocabulary.SCENE), "medium"))


def read_settings(source: Source, root: Usd.Prim, duration: float | None) -> Settings:
    """How to step, from OtSceneAPI, and the length of the run, from the stage's time codes.

    Raises:
        InputError: Time codes that end before they start, or a frame rate that is not positive.
    """
    values = read_values(source.file, root, vocabulary.SCENE)
    stage = source.stage
    frames = stage.GetFramesPerSecond() if stage.HasAuthoredMetadata("framesPerSecond") else source.rate
    if not (math.isfinite(frames) and frames > 0.0):
        raise source.bad("/", "framesPerSecond", frames, "in (0, inf)")
    if duration is not None and not (math.isfinite(duration) and duration > 0.0):
        raise source.bad("/", "duration", duration, "in (0, inf) s")
    if duration is None:
        authored = stage.HasAuthoredTimeCodeRange()
        duration = (stage.GetEndTimeCode() - source.start) / source.rate if authored else Settings.duration
        if not (math.isfinite(duration) and duration > 0.0):
            raise source.bad("/", "endTimeCode", stage.GetEndTimeCode(), f"in ({source.start:g}, inf)")
    return Settings(duration=duration, frames_per_second=frames, **part(values, "settings"))


def read_flow(source: Source, prims: Sequence[Usd.Prim]) -> Flow | None:
    """The background flow, if any.

    Raises:
        InputError: More than one, a mirrored one, or a velocity field that cannot be read or is scaled.
    """
    prim = _at_most_one(source, prims, "OtFlowAPI")
    if prim is None:
        return None
    values = read_values(source.file, prim, vocabulary.FLOW)
    position, rotation = _placed(source, prim)
    field = None
    if values["kind"] == "grid" and values["file"]:
        asset = source.values.value(prim, "ot:flow:file", types=("asset",))
        try:
            field = read_flow_grid(Path(asset.resolvedPath or asset.path))
        except InputError as error:
            raise source.bad(prim, "ot:flow:file", asset.path, f"a velocity field; {error}") from None
        _check_unscaled(source, prim)
    return Flow(prim=str(prim.GetPath()), origin=vec3(position), orientation=quat(rotation), field=field, **values)


def read_camera(source: Source, prims: Sequence[Usd.Prim]) -> Camera | None:
    """The microscope, if any.

    Raises:
        InputError: More than one, a mirrored one, or not on a Camera.
    """
    prim = _at_most_one(source, prims, "OtCameraAPI")
    if prim is None:
        return None
    if not prim.IsA(UsdGeom.Camera):
        raise source.bad(prim, "apiSchemas", "OtCameraAPI", f"on a Camera, not a {prim.GetTypeName()}")
    position, rotation = _placed(source, prim)
    turn = quat(rotation)
    center = rotate(conjugate(np.array(turn)), np.array(position))
    lens = check_lens(source.values, prim)
    flat = source.values.value(prim, "projection", types=("token",)) == "orthographic"
    # apertures are tenths of the scene's unit, in single precision; a perspective view has no frame in the object plane
    size = [float(f"{0.1 * source.unit * lens[f'{side}Aperture']:.6g}") for side in ("horizontal", "vertical")]
    frame = {"frame": (size[0], size[1])} if flat else {}
    values = read_values(source.file, prim, vocabulary.CAMERA)
    middle = (round(float(center[0]), 9) + 0.0, round(float(center[1]), 9) + 0.0)
    return Camera(prim=str(prim.GetPath()), center=middle, orientation=turn, **frame, **values)


def read_goal(source: Source, prims: Sequence[Usd.Prim]) -> Goal | None:
    """The task, if any.

    Raises:
        InputError: More than one, or not one cell.
    """
    prim = _at_most_one(source, prims, "OtGoalAPI")
    if prim is None:
        return None
    values = read_values(source.file, prim, vocabulary.GOAL)
    named = values["cell"]
    if len(named) != 1:
        raise source.bad(prim, "ot:goal:cell", ", ".join(named) or "(no target)", DELIVERED)
    return Goal(prim=str(prim.GetPath()), position=vec3(source.pose(prim)[0]), **values | {"cell": named[0]})


def _placed(source: Source, prim: Usd.Prim) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) and quaternion (4,) of a prim at the start, whose size does not matter.

    Raises:
        InputError: A reflection, of which no rotation is left: the prim's axes would point elsewhere.
    """
    position, rotation, scale = source.pose(prim)
    if np.prod(scale) < 0.0:
        shown = ", ".join(f"{s / source.unit:g}" for s in scale)
        raise source.bad(
            prim, "xformOp:scale", f"({shown}), mirrored", "no reflection of the prim or above it; turn it"
        )
    return position, rotation


def _check_unscaled(source: Source, prim: Usd.Prim) -> None:
    """Refuse a scale of a velocity field, whose places are in metres; that of a file in another unit changes nothing.

    Raises:
        InputError: The prim, or one above it, is scaled.
    """
    above = prim
    while above and not above.IsPseudoRoot():
        if above.HasAttribute(f"xformOp:scale:{METRES}"):
            return  # a copy in metres, flattened, which no longer says what else is a conversion
        above = above.GetParent()
    scale = source.pose(prim)[2] / source.unit
    roots = [spec.layer.pseudoRoot for spec in prim.GetPrimStack()]
    units = [1e6 * root.GetInfo("metersPerUnit") / source.unit for root in roots if root.HasInfo("metersPerUnit")]
    if not any(np.allclose(scale, unit, rtol=_UNSCALED, atol=0.0) for unit in (1.0, *units)):
        shown = ", ".join(f"{s:g}" for s in scale)
        allowed = "(1, 1, 1) on a velocity field and above it, whose places in its file are in metres; change them"
        raise source.bad(prim, "xformOp:scale", f"({shown})", allowed)


def _at_most_one(source: Source, prims: Sequence[Usd.Prim], schema: str) -> Usd.Prim | None:
    if len(prims) > 1:
        raise source.bad(prims[1], "apiSchemas", schema, f"on one prim only; {prims[0].GetPath()} has it already")
    return prims[0] if prims else None
