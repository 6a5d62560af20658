"""What a calibration file says of the camera that a twin looks through, and whether it is that camera's."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.vision.calibration.file import Calibration, load_calibration
from otwarp.vision.view import camera_of, image_size

SAME = 0.02
"""Relative difference of a pixel up to which it is of the same camera."""

OPTICS = ("numerical_aperture", "wavelength")
"""What of the optics must be the same."""

AS_AUTHORED = "scene"
"""Instead of a file: the scene's camera is taken as it is."""


def calibrated(scene: Scene, file: str | None, *, simulated: bool, camera: str) -> Scene:
    """The scene with its camera as a calibration has it: size of a pixel, and focal plane below the traps.

    Args:
        scene: With its camera.
        file: The calibration; `scene` for none; None: none was given.
        simulated: Whether the camera is the scene's own, which needs none.
        camera: As the user named it.

    Raises:
        InputError: It is missing where a real camera needs it, cannot be read, or is of another camera.
    """
    if file is None and not simulated:
        raise InputError(
            f"--calibration is missing for --camera {camera}; allowed: what otwarp vision calibrate wrote, or "
            f"{AS_AUTHORED} to take the scene's camera as it is"
        )
    if not simulated and camera_of(scene).bits != 8:
        # whatever it gives, eight bits of it are looked at
        scene = dataclasses.replace(scene, camera=dataclasses.replace(camera_of(scene), bits=8))
    if file in (None, AS_AUTHORED):
        return scene
    assert file is not None
    found, own = load_calibration(Path(file)), camera_of(scene)
    pixel = found.results.get("pixel")
    if pixel is None:
        raise InputError(f"--calibration {file} says no pixel; allowed: one that does")
    _check(found, file, scene)
    # the frame has as many pixels as before: its middle, from which places count, is that of the camera's images
    wide, high = image_size(own)
    changed = dataclasses.replace(own, pixel_size=pixel.value, frame=(wide * pixel.value, high * pixel.value))
    heights = {round(float(t.position.at(0.0)[2]), 6) for t in scene.traps}
    plane = found.results.get("trap_plane")
    if plane is not None and not simulated and len(heights) == 1 and own.orientation[3] > 1.0 - 1e-9:
        changed = dataclasses.replace(changed, focus=heights.pop() - plane.value)
    return dataclasses.replace(scene, camera=changed)


def _check(found: Calibration, file: str, scene: Scene) -> None:
    """Refuse the calibration of another camera."""
    camera, pixel = camera_of(scene), found.results["pixel"]
    if abs(pixel.value / camera.pixel_size - 1.0) > SAME:
        raise InputError(
            f"--calibration {file} is of another camera: its pixel is {pixel.value:.4g} µm; allowed: that of "
            f"{camera.prim}, {camera.pixel_size:.4g} µm within {100 * SAME:g} %"
        )
    told: Any = found.source.get("optics", {})
    for name in OPTICS:
        value, own = told.get(name) if isinstance(told, dict) else None, getattr(camera, name)
        if isinstance(value, int | float) and abs(value / own - 1.0) > 1e-3:
            raise InputError(
                f"--calibration {file} is of another camera: its {name} is {value:g}; allowed: that of {camera.prim}, "
                f"{own:g}"
            )
