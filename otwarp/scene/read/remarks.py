"""What USD lets a file say without any effect: reported beside the scene, since the `Scene` no longer shows it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from pxr import Pcp, Sdf, Usd, UsdGeom

from otwarp.scene.finding import Finding
from otwarp.scene.read.source import Source

_INVERSE = "!invert!"
_ARCS = (Pcp.ArcTypeReference, Pcp.ArcTypePayload)
_UNITS_ALIKE = 0.01
"""Relative difference of a scale from the ratio of two units that still is a conversion."""

_UPRIGHT = 0.7
"""Least cosine of the tilt of a part that counts as turned upright: a part may lean."""

_TURNS = ("quatd", "quatf", "quath")


def remarks(source: Source, placed: Iterable[Usd.Prim]) -> Iterator[Finding]:
    """Warnings about a file that can be read.

    Args:
        source: The open stage.
        placed: Prims of which only the place at the start counts: bodies, flow and goal.
    """
    for prim in Usd.PrimRange(source.stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        yield from _unlisted(source, prim)
        yield from _of_another_unit(source, prim)
        yield from _of_another_up(source, prim)
    for prim in placed:
        yield from _played(prim)


def _unlisted(source: Source, prim: Usd.Prim) -> Iterator[Finding]:
    """Transform ops that `xformOpOrder` leaves out, which USD then ignores."""
    if not prim.IsA(UsdGeom.Xformable):
        return
    authored = [a for a in prim.GetAuthoredAttributes() if a.GetNamespace() and a.GetName().startswith("xformOp:")]
    if not authored:
        return
    listed = {op.removeprefix(_INVERSE) for op in source.values.value(prim, "xformOpOrder", absent=())}
    unlisted = [a for a in authored if a.GetName() not in listed and a.HasAuthoredValue()]
    idle = [a.GetName() for a in unlisted if not _turns_nothing(source, prim, a)]
    if idle:
        message = f"{', '.join(idle)} has no effect: xformOpOrder does not name it"
        yield Finding(prim=str(prim.GetPath()), message=message)


def _of_another_unit(source: Source, prim: Usd.Prim) -> Iterator[Finding]:
    """References and payloads to files of another length unit, which USD does not convert and no scale here does."""
    layers = _brought_in(prim, "metersPerUnit")
    if not layers:
        return
    stage_unit = UsdGeom.GetStageMetersPerUnit(source.stage)
    around = np.linalg.norm(source.matrix(prim)[:3, :3], axis=1)
    above = np.linalg.norm(source.matrix(prim.GetParent())[:3, :3], axis=1)
    for layer in layers:
        unit = layer.pseudoRoot.GetInfo("metersPerUnit")
        wanted = unit / stage_unit
        scales = (np.ones(3), around, around / above)  # the same unit needs none
        if any(np.allclose(scale, wanted, rtol=_UNITS_ALIKE, atol=0.0) for scale in scales):
            continue
        message = (
            f"{Path(layer.realPath).name} has metersPerUnit = {unit:g}, this stage {stage_unit:g}, and USD does not "
            f"convert: its numbers count in units of the stage; scale the prim by {wanted:g}"
        )
        yield Finding(prim=str(prim.GetPath()), message=message)


def _of_another_up(source: Source, prim: Usd.Prim) -> Iterator[Finding]:
    """References and payloads to files in which Y is up, which USD does not turn and no rotation here does."""
    for layer in _brought_in(prim, "upAxis"):
        if layer.pseudoRoot.GetInfo("upAxis") != UsdGeom.Tokens.y:
            continue
        own = UsdGeom.XformCache(source.start).GetLocalTransformation(prim)[0]
        ups = (np.array(own)[1, :3], source.matrix(prim)[1, :3])  # where its Y points, beside the parent and here
        if any(up[2] > _UPRIGHT * np.linalg.norm(up) for up in ups):
            continue
        message = (
            f"{Path(layer.realPath).name} has upAxis = Y, this stage Z, and USD does not turn it: its Y is the "
            "stage's Y; turn the prim by 90 degrees about X"
        )
        yield Finding(prim=str(prim.GetPath()), message=message)


def _brought_in(prim: Usd.Prim, info: str) -> list[Sdf.Layer]:
    """Layers that the prim itself references or has as payloads, of those that author a piece of metadata."""
    if prim.IsInstanceProxy() or not (prim.HasAuthoredReferences() or prim.HasAuthoredPayloads()):
        return []
    arcs = [
        a
        for a in Usd.PrimCompositionQuery(prim).GetCompositionArcs()
        if a.GetArcType() in _ARCS and not a.IsAncestral()
    ]
    return [layer for arc in arcs if (layer := arc.GetTargetLayer()).pseudoRoot.HasInfo(info)]


def _turns_nothing(source: Source, prim: Usd.Prim, op: Usd.Attribute) -> bool:
    """Whether it is a rotation that is none: in a file of a body, for those who place it to change or to leave out."""
    if str(op.GetTypeName()) not in _TURNS or op.GetNumTimeSamples():
        return False
    value = source.values.value(prim, op.GetName(), types=_TURNS, absent=None)
    return value is not None and value == type(value).GetIdentity()


def _played(prim: Usd.Prim) -> Iterator[Finding]:
    """Time samples that place what the simulation moves."""
    path, ancestor = str(prim.GetPath()), prim
    if prim.IsA(UsdGeom.PointInstancer):
        for name in ("positions", "orientations", "orientationsf", "scales"):
            if prim.GetAttribute(name).GetNumTimeSamples() > 1:
                yield Finding(prim=path, message=f"time samples of {name} are not played: only the start counts")
    while ancestor and not ancestor.IsPseudoRoot():
        xformable = UsdGeom.Xformable(ancestor)
        if xformable:
            if xformable.TransformMightBeTimeVarying():
                of = "" if ancestor == prim else f" of {ancestor.GetPath()}"
                message = f"time samples of the transform{of} are not played: only the place at the start counts"
                yield Finding(prim=path, message=message)
                return
            if xformable.GetResetXformStack():
                return
        ancestor = ancestor.GetParent()
