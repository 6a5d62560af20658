"""What a scene's camera sees: its microscope, its sensor, and the bodies as solids in its frame."""

from __future__ import annotations

import math

import numpy as np

from otwarp.errors import InputError
from otwarp.scene import Body, Camera, Scene, Vec3
from otwarp.scene.transforms import conjugate, rotate
from otwarp.vision.microscope import Microscope
from otwarp.vision.sensor import Sensor
from otwarp.vision.specimen import Specimen


def camera_of(scene: Scene) -> Camera:
    """The scene's microscope.

    Raises:
        InputError: It has none.
    """
    if scene.camera is None:
        how = 'prepend apiSchemas = ["OtCameraAPI"] at a Camera of the file, or SceneBuilder.add(Camera(...))'
        raise InputError(f"{scene.file or scene.root}: the scene has no camera with OtCameraAPI; allowed: one ({how}; "
                         "docs/vision.md shows it)")  # fmt: skip
    return scene.camera


def microscope_of(scene: Scene) -> Microscope:
    """The microscope that a scene's camera describes, in its medium.

    Raises:
        InputError: No camera, or one that cannot be.
    """
    camera = camera_of(scene)
    zernike = {4: camera.defocus, 6: camera.astigmatism, 8: camera.coma, 11: camera.spherical_aberration}
    try:
        return Microscope(
            numerical_aperture=camera.numerical_aperture,
            condenser_aperture=camera.condenser_aperture,
            condenser=camera.condenser_shape,
            condenser_inner=camera.condenser_inner,
            wavelength=camera.wavelength,
            bandwidth=camera.bandwidth,
            medium_index=scene.medium.refractive_index,
            immersion_index=camera.immersion_index,
            contrast=camera.contrast,
            ring_delay=camera.ring_delay,
            ring_transmission=camera.ring_transmission,
            shear=camera.shear,
            shear_angle=camera.shear_angle,
            bias=camera.bias,
            depth=camera.depth,
            zernike={noll: rms for noll, rms in zernike.items() if rms},
            pixel=camera.pixel_size,
        )
    except InputError as error:
        raise InputError(f"{scene.file or scene.root}: {camera.prim}: {error}") from None


def sensor_of(scene: Scene) -> Sensor:
    """The sensor of a scene's camera."""
    camera = camera_of(scene)
    return Sensor(
        brightness=camera.brightness,
        electrons=camera.electrons,
        noise=camera.noise,
        nonuniformity=camera.nonuniformity,
        bits=camera.bits,
        gamma=camera.gamma,
    )


def image_size(camera: Camera) -> tuple[int, int]:
    """Pixels of the camera's whole image (width, height)."""
    width, height = (max(1, math.floor(side / camera.pixel_size + 1e-9)) for side in camera.frame)
    return width, height


def solids_of(body: Body) -> list[tuple[Vec3, Vec3, float, float]]:
    """Centres of the rounded ends [µm, body frame], radius [µm] and refractive index of a body's spheres, then rods.

    A rod that has no index of its own has that of the body's first sphere.
    """
    solids = [(s.offset, s.offset, s.radius, s.refractive_index) for s in body.spheres]
    for rod in body.rods:
        index = body.spheres[0].refractive_index if rod.refractive_index is None else rod.refractive_index
        solids.append((rod.start, rod.end, rod.radius, index))
    return solids


def specimen_of(scene: Scene, position: np.ndarray, orientation: np.ndarray) -> Specimen:
    """All bodies as solids in the frame of the scene's camera: its middle at x = y = 0, heights along its axis.

    Obstacles are not seen.

    Args:
        scene: Its bodies and camera.
        position: (B, 3) origins of the bodies' prims [µm].
        orientation: (B, 4) quaternions (x, y, z, w).
    """
    camera = camera_of(scene)
    start, end, radius, index = [], [], [], []
    for body, place, turn in zip(scene.bodies, position, orientation, strict=True):
        for first, last, thick, optical in solids_of(body):
            start.append(rotate(turn, np.array(first)) + place)
            end.append(rotate(turn, np.array(last)) + place)
            radius.append(thick)
            index.append(optical)
    back = conjugate(np.array(camera.orientation))
    shift = np.array([*camera.center, 0.0])
    first, last = (rotate(back, np.array(e).reshape(-1, 3)) - shift for e in (start, end))
    return Specimen(first, last, np.array(radius), np.array(index))
