"""Camera and lights of a stage → `View` and `Lights`; a camera that frames the scene where the stage has none."""

from __future__ import annotations

import numpy as np
from pxr import Usd, UsdGeom, UsdLux

from otwarp.errors import InputError
from otwarp.scene.drawing.draw_list import Lights, View
from otwarp.scene.read.lenses import check_lens
from otwarp.scene.read.typed import Values

_APERTURE_UNIT = 0.1
"""UsdGeomCamera measures focal length and apertures in tenths of the scene unit."""

AUTOMATIC_FIELD = np.radians(32.0)
"""Vertical field of view of the automatic camera."""

STOPS = 100.0
"""Largest exposure of a light: 2¹⁰⁰ is about the largest number that a stage may hold."""


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / max(float(np.linalg.norm(vector)), 1e-300)


def find_camera(stage: Usd.Stage, name: str | None, file: str) -> Usd.Prim | None:
    """The camera called `name` (a path, or a prim name), or without a name the first one; None if there is none.

    Raises:
        InputError: No camera of that name.
    """
    prims = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate))
    cameras = [prim for prim in prims if prim.IsA(UsdGeom.Camera)]
    if name is None:
        return cameras[0] if cameras else None
    for prim in cameras:
        if name in (str(prim.GetPath()), prim.GetName()):
            return prim
    known = ", ".join(str(prim.GetPath()) for prim in cameras) or "none"
    raise InputError(f"{file}: camera '{name}' is not in the stage; cameras: {known}")


def read_view(prim: Usd.Prim, to_world: np.ndarray, scale: float, centre: np.ndarray, values: Values) -> View:
    """The view through a UsdGeomCamera.

    Args:
        prim: The camera.
        to_world: (4, 4) its transform in stage units.
        scale: µm per stage unit.
        centre: (3,) centre of the scene [µm], measured there when the camera has no focus distance.
        values: Reads attributes at the time wanted.

    Raises:
        InputError: Focal length or aperture is not positive.
    """
    lens = check_lens(values, prim)
    orthographic = values.value(prim, "projection") == UsdGeom.Tokens.orthographic
    right, up, backward = (_unit(to_world[:3, k]) for k in range(3))
    position = to_world[:3, 3] * scale
    unit = _APERTURE_UNIT * scale if orthographic else 1.0 / lens["focalLength"]
    near, far = (float(v) * scale for v in values.value(prim, "clippingRange"))
    focus = values.number(prim, "focusDistance") * scale
    if focus <= 0.0:
        focus = max(float((centre - position) @ -backward), 1e-9)
    offsets = [values.number(prim, f"{way}ApertureOffset") for way in ("horizontal", "vertical")]
    return View(
        prim=str(prim.GetPath()),
        position=position,
        right=right,
        up=up,
        forward=-backward,
        orthographic=orthographic,
        width=lens["horizontalAperture"] * unit,
        height=lens["verticalAperture"] * unit,
        shift=(offsets[0] * unit, offsets[1] * unit),
        near=near,
        far=far,
        focus=focus,
    )


def automatic_view(lower: np.ndarray, upper: np.ndarray, up: np.ndarray, aspect: float = 16.0 / 9.0) -> View:
    """A three-quarter view from above that frames the boxes between `lower` and `upper`, (n, 3) each [µm]."""
    side = np.array([1.0, 0.0, 0.0])
    ahead = _unit(np.cross(up, side))
    forward = _unit(0.42 * side + 0.9 * ahead - 0.62 * up)
    right = _unit(np.cross(forward, up))
    true_up = np.cross(right, forward)
    corners = np.concatenate([np.where(mask, upper, lower) for mask in np.ndindex(2, 2, 2)])
    centre = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    tangent = np.tan(0.5 * AUTOMATIC_FIELD)
    offset = corners - centre
    depth = offset @ forward
    # A corner is inside the window when |offset| ≤ tangent · (distance + depth); 12 % margin.
    needed = np.maximum(np.abs(offset @ true_up), np.abs(offset @ right) / aspect) / tangent * 1.12 - depth
    distance = max(float(needed.max()), 1e-6)
    return View(
        position=centre - distance * forward,
        right=right,
        up=true_up,
        forward=forward,
        width=2.0 * tangent * aspect,
        height=2.0 * tangent,
        focus=distance,
    )


def _irradiance(prim: Usd.Prim, distance: float, scale: float, values: Values) -> float:
    """Relative irradiance that a light casts on the centre of the scene.

    Raises:
        InputError: An exposure of more than `STOPS`.
    """

    def get(name: str, default: float) -> float:
        return values.number(prim, name, absent=default)

    stops = get("inputs:exposure", 0.0)
    if abs(stops) > STOPS:
        raise values.bad(prim, "inputs:exposure", stops, f"in [-{STOPS:g}, {STOPS:g}]")
    strength = get("inputs:intensity", 1.0) * 2.0**stops
    if prim.IsA(UsdLux.DistantLight):
        return strength
    if prim.IsA(UsdLux.DomeLight) or prim.IsA(UsdLux.DomeLight_1):
        return np.pi * strength
    if prim.IsA(UsdLux.RectLight):
        area = get("inputs:width", 1.0) * get("inputs:height", 1.0)
    else:  # sphere, disk and cylinder lights: the disc they show
        area = np.pi * get("inputs:radius", 0.5) ** 2
    normalised = values.value(prim, "inputs:normalize", absent=False)
    return strength * (1.0 if normalised else area * scale**2) / max(distance, 1e-9) ** 2


def read_lights(lights: list[tuple[Usd.Prim, np.ndarray]], scale: float, centre: np.ndarray, values: Values) -> Lights:
    """Lights from UsdLux prims with their (4, 4) transforms in stage units."""
    vectors: list[np.ndarray] = []
    distant: list[bool] = []
    power: list[np.ndarray] = []
    ambient = np.zeros(3)
    for prim, to_world in lights:
        given = values.array(prim, "inputs:color")
        colour = given if len(given) else np.ones(3)
        is_distant = prim.IsA(UsdLux.DistantLight)
        position = to_world[:3, 3] * scale
        strength = _irradiance(prim, float(np.linalg.norm(position - centre)), scale, values) * colour
        if prim.IsA(UsdLux.DomeLight) or prim.IsA(UsdLux.DomeLight_1):
            ambient = ambient + strength
            continue
        vectors.append(_unit(to_world[:3, 2]) if is_distant else position)
        distant.append(is_distant)
        power.append(strength)
    return Lights(
        vector=np.array(vectors).reshape(-1, 3),
        distant=np.array(distant, dtype=bool),
        irradiance=np.array(power).reshape(-1, 3),
        ambient=ambient,
    )
