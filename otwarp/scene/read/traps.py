"""Reads optical traps: beam, force curves, and the time samples of position and power."""

from __future__ import annotations

import numpy as np
from pxr import Usd, UsdGeom

from otwarp.laws import TrapLaw
from otwarp.scene import vocabulary
from otwarp.scene.description import OPTICAL_MODELS, Track, Trap
from otwarp.scene.read.attributes import read_values
from otwarp.scene.read.motion import motion
from otwarp.scene.read.source import Source, quat, track
from otwarp.scene.vocabulary.values import check, internal

TIME_SLACK = 1e-9
"""How far the samples of a moving trap may fall short of the run [s]: rounding of time codes."""

_TURN = 1e-6
"""Largest change of a component of a trap's quaternion that counts as no rotation."""


def read_trap(source: Source, prim: Usd.Prim, duration: float) -> Trap:
    """Read one prim with OtTrapAPI.

    Raises:
        InputError: No force curve where the model needs one, time samples that do not cover the run, a trap that turns.
    """
    if not prim.IsA(UsdGeom.Xformable):
        raise source.bad(prim, "apiSchemas", "OtTrapAPI", "on an Xform")
    values = read_values(source.file, prim, vocabulary.TRAP)
    held = values.pop("holds")
    if len(held) > 1:
        raise source.bad(prim, "ot:trap:holds", ", ".join(held), "one prim path")
    position, orientation = _motion(source, prim)
    power = _power(source, prim, values["power"])
    for name, samples in (("xformOp:translate", position), ("ot:trap:power", power)):
        _check_cover(source, prim, name, samples, duration)
    radial, axial = _laws(source, prim, values["model"])
    values |= {"position": position, "power": power, "orientation": orientation, "radial": radial, "axial": axial}
    return Trap(prim=str(prim.GetPath()), holds=held[0] if held else None, **values)


def _motion(source: Source, prim: Usd.Prim) -> tuple[Track, tuple[float, float, float, float]]:
    times, positions, rotations, _ = motion(source, prim)
    if np.abs(rotations - rotations[0]).max() > _TURN:
        raise source.bad(prim, "xformOp:orient", "(time samples that turn)", "constant: a trap may move, not turn")
    return track(times, positions), quat(rotations[0])


def _power(source: Source, prim: Usd.Prim, constant: float) -> Track:
    name = "ot:trap:power"
    codes, samples = source.values.samples(prim, name, types=("double",))
    if not codes:
        return Track.constant(constant)
    for sample in samples:
        check(source.file, prim.GetPath(), name, vocabulary.TRAP["power"], sample)
    return track(source.seconds(np.array(codes)), np.array([[internal(sample, "power")] for sample in samples]))


def _check_cover(source: Source, prim: Usd.Prim, name: str, samples: Track, duration: float) -> None:
    first, last = float(samples.times[0]), float(samples.times[-1])
    if samples.animated and (first > TIME_SLACK or last < duration - TIME_SLACK):
        span = f"time samples from {first:g} s to {last:g} s"
        late = last < duration - TIME_SLACK
        at = f"{source.start + (source.rate * duration if late else 0.0):g}"
        remedy = f"the {'last' if late else 'first'} value again at time code {at} holds it"
        raise source.bad(prim, name, span, f"samples that cover the run, [0, {duration:g}] s; {remedy}")


def _laws(source: Source, prim: Usd.Prim, model: str) -> tuple[TrapLaw | None, TrapLaw | None]:
    prefix = vocabulary.TRAP_LAW.name + ":"
    found = {name.removeprefix(prefix) for name in source.applied(prim) if name.startswith(prefix)}
    optical = model in OPTICAL_MODELS
    if optical and not found:
        return None, None
    if found not in ({"isotropic"}, {"radial", "axial"}):
        shown = ", ".join(sorted(found)) or "(none)"
        or_none = "or none" if optical else "or none with ot:trap:model = table"
        raise source.bad(prim, "OtTrapLawAPI", shown, f"isotropic alone, or radial and axial together, {or_none}")
    laws = {name: _law(source, prim, name, model) for name in found}
    return (laws["isotropic"], None) if "isotropic" in laws else (laws["radial"], laws["axial"])


def _law(source: Source, prim: Usd.Prim, instance: str, model: str) -> TrapLaw:
    raw = read_values(source.file, prim, vocabulary.TRAP_LAW, instance=instance, si=True)
    length, force = internal(raw["length_unit"], "length"), internal(raw["force_unit"], "force")
    common = {
        "stiffness": raw["stiffness"] * force / length,
        "cutoff": raw["cutoff"] * length,
        "power": internal(raw["power"], "power"),
        "radius": raw["radius"] * length,
    }
    if model == "harmonic":  # a harmonic trap has no other branch
        return TrapLaw(**common)
    return TrapLaw(
        **common,
        threshold=raw["threshold"] * length,
        inverse_square=raw["inverse_square"] * force * length * length,  # a power would overflow with an exception
        offset=raw["offset"] * force,
    )
