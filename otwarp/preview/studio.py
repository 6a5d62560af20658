"""Upload of a draw list to the device, and the studio it is shown in: exposure, default lights, background, grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.preview.kernels.shading import Light, Studio
from otwarp.preview.kernels.tracing import TracedSolid, World
from otwarp.scene.drawing.draw_list import PLANE, Drawables, Lights, View

EXPOSURE = 1.12
"""Irradiance of all lights together at the scene: white facing them is just below full scale."""

AMBIENT_SHARE = (0.2, 0.34)
"""Smallest and largest share of the exposure that is ambient: neither black shadows nor flat shapes."""

ENDLESS = 1.0e30
"""Half size of an infinite plane on the device."""

LARGEST_SIDE, MOST_SAMPLES = 16384, 16
"""Pixels, and samples of a pixel, along each side."""

MOST_LIGHTS = 4
FILL_SHARE = 0.25
"""Lights weaker than this share of the strongest one cast no shadows: they would cost rays and hardly show."""


@dataclass(frozen=True)
class Style:
    """Linear colours of the background (middle, edge), and the share of ambient light that comes from the ground."""

    middle: tuple[float, float, float]
    edge: tuple[float, float, float]
    ground: float


STYLES = {
    "dark": Style((0.030, 0.048, 0.072), (0.004, 0.007, 0.013), 0.3),
    "light": Style((0.93, 0.945, 0.96), (0.62, 0.68, 0.74), 0.6),
    "white": Style((1.0, 1.0, 1.0), (1.0, 1.0, 1.0), 0.7),
}


@dataclass(frozen=True, kw_only=True)
class PictureStyle:
    """Size and quality of a picture.

    Attributes:
        width, height: Pixels, 1 to `LARGEST_SIDE`.
        samples: Samples per pixel along each side where the picture has detail, 1 to 16 (3: 9 samples).
        occlusion_rays: Rays of ambient occlusion per sample; 0 switches it off.
        style: Background, a key of `STYLES`: `dark`, `light` or `white`.
        grid: Whether planes carry grid lines at a round distance.

    Raises:
        InputError: Size, samples or style out of range.
    """

    width: int = 1280
    height: int = 720
    samples: int = 3
    occlusion_rays: int = 2
    style: str = "dark"
    grid: bool = True

    def __post_init__(self) -> None:
        for name, high in (("width", LARGEST_SIDE), ("height", LARGEST_SIDE), ("samples", MOST_SAMPLES)):
            value = getattr(self, name)
            if not 1 <= value <= high:
                raise InputError(f"{name} = {value}, allowed [1, {high}]")
        if self.style not in STYLES:
            raise InputError(f"style = '{self.style}', allowed: {', '.join(STYLES)}")


@dataclass
class Uploaded:
    """Structs for the kernel, and the objects that must outlive them."""

    world: Annotated[Any, World]
    studio: Annotated[Any, Studio]
    keep: list[object]


def _rows(struct: Any, count: int) -> np.ndarray:
    """`count` empty rows of a Warp struct, as NumPy has them."""
    return np.zeros(count, dtype=struct.numpy_dtype())


def _records(drawables: Drawables, chosen: np.ndarray, origin: np.ndarray, meshes: list[wp.Mesh]) -> np.ndarray:
    """Structured array of `TracedSolid` for the shapes `chosen`, relative to `origin`."""
    records = _rows(TracedSolid, len(chosen))
    if len(chosen) == 0:
        return records
    matrix = drawables.transform[chosen]
    linear = np.linalg.inv(matrix[:, :3, :3])
    records["linear"] = linear
    records["shift"] = -np.einsum("nij,nj->ni", linear, matrix[:, :3, 3] - origin)
    records["kind"] = drawables.kind[chosen]
    records["size"] = np.minimum(drawables.size[chosen], ENDLESS)
    for name in ("colour", "opacity", "roughness"):
        records[name] = getattr(drawables, name)[chosen]
    corners = np.cumsum([0] + [3 * len(mesh.triangles) for mesh in drawables.meshes])
    own = drawables.mesh[chosen]
    for index, mesh in enumerate(meshes):
        records["mesh"][own == index] = mesh.id
        records["first"][own == index] = corners[index]
    return records


def _hierarchy(lower: np.ndarray, upper: np.ndarray, device: wp.Device) -> wp.Bvh | None:
    if len(lower) == 0:
        return None
    margin = 1e-5 * (1.0 + np.abs(lower).max() + np.abs(upper).max())
    corners = [
        wp.array(values.astype(np.float32), dtype=wp.vec3, device=device) for values in (lower - margin, upper + margin)
    ]
    return wp.Bvh(corners[0], corners[1])


def upload_world(
    drawables: Drawables, origin: np.ndarray, device: wp.Device
) -> tuple[Annotated[Any, World], list[object]]:
    """The shapes on the device, relative to `origin` (3,) µm, and the objects to keep alive."""
    meshes = [
        wp.Mesh(
            points=wp.array(mesh.points.astype(np.float32), dtype=wp.vec3, device=device),
            indices=wp.array(mesh.triangles.astype(np.int32).ravel(), dtype=wp.int32, device=device),
        )
        for mesh in drawables.meshes
    ]
    lower, upper = drawables.bounds()
    endless = (drawables.kind == PLANE) & ~np.isfinite(lower).all(axis=1)
    beams = np.flatnonzero(drawables.beam)
    bounded = np.flatnonzero(~endless & ~drawables.beam)
    solids = np.concatenate([np.flatnonzero(endless & ~drawables.beam), bounded])
    corner = np.concatenate([mesh.normals.reshape(-1, 3) for mesh in drawables.meshes] or [np.zeros((1, 3))])

    world = World()
    bvh = _hierarchy(lower[bounded] - origin, upper[bounded] - origin, device)
    beam_bvh = _hierarchy(lower[beams] - origin, upper[beams] - origin, device)
    world.solids = wp.array(_records(drawables, solids, origin, meshes), dtype=TracedSolid, device=device)
    world.beams = wp.array(_records(drawables, beams, origin, meshes), dtype=TracedSolid, device=device)
    world.corner = wp.array(corner.astype(np.float32), dtype=wp.vec3, device=device)
    world.endless, world.count, world.beam_count = len(solids) - len(bounded), len(bounded), len(beams)
    world.bvh = bvh.id if bvh else wp.uint64(0)
    world.beam_bvh = beam_bvh.id if beam_bvh else wp.uint64(0)
    return world, [meshes, bvh, beam_bvh]


def default_lights(view: View, up: np.ndarray) -> Lights:
    """A key light over the left shoulder, a weak fill from the right, and a dome."""
    key = 1.1 * up - 0.75 * view.right - 0.45 * view.forward
    fill = 0.35 * up + 0.9 * view.right - 0.25 * view.forward
    return Lights(
        vector=np.array([key / np.linalg.norm(key), fill / np.linalg.norm(fill)]),
        distant=np.array([True, True]),
        irradiance=np.array([[0.74, 0.72, 0.68], [0.10, 0.12, 0.15]]),
        ambient=np.array([0.20, 0.225, 0.27]),
    )


def exposed(lights: Lights) -> Lights:
    """The strongest few lights, scaled so that direct and ambient light add up to `EXPOSURE`."""
    strength = lights.irradiance.max(axis=1) if len(lights.irradiance) else np.zeros(0)
    order = np.argsort(-strength, kind="stable")[:MOST_LIGHTS]
    order = order[strength[order] > 0.01 * strength.max(initial=0.0)]
    direct, dome = float(strength[order].sum()), float(lights.ambient.max())
    share = float(np.clip(dome / max(direct + dome, 1e-300), *AMBIENT_SHARE)) if direct > 0.0 else 1.0
    tint = lights.ambient / dome if dome > 0.0 else np.ones(3)
    return Lights(
        vector=lights.vector[order],
        distant=lights.distant[order],
        irradiance=lights.irradiance[order] * (EXPOSURE * (1.0 - share) / max(direct, 1e-300)),
        ambient=tint * (EXPOSURE * share),
    )


def nice_length(about: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above `about`."""
    power = 10.0 ** np.floor(np.log10(about))
    return float(next(step * power for step in (5.0, 2.0, 1.0) if step * power <= about * (1.0 + 1e-9)))


def arrange(drawables: Drawables, look: PictureStyle, device: wp.Device) -> Uploaded:
    """Everything the kernels need for one picture."""
    view, style = drawables.view, STYLES[look.style]
    focus = view.position + view.focus * view.forward
    # Coordinates relative to what is looked at keep float32 precise wherever the scene lies.
    world, keep = upload_world(drawables, focus, device)
    given = drawables.lights
    lights = exposed(given if len(given.vector) or given.ambient.any() else default_lights(view, drawables.up))
    records = _rows(Light, len(lights.vector))
    records["vector"] = np.where(lights.distant[:, None], lights.vector, lights.vector - focus)
    records["distant"], records["irradiance"] = lights.distant, lights.irradiance
    strength = lights.irradiance.max(axis=1, initial=0.0)
    records["shadows"] = strength > FILL_SHARE * strength.max(initial=0.0)

    studio = Studio()
    window = view.window(look.width, look.height)
    studio.position = wp.vec3(*(view.position - focus))
    studio.right, studio.up, studio.forward = (wp.vec3(*axis) for axis in (view.right, view.up, view.forward))
    studio.orthographic = int(view.orthographic)
    studio.window, studio.shift = wp.vec2(*window), wp.vec2(*view.shift)
    studio.near, studio.far = view.near, min(view.far, 1e29)
    studio.width, studio.height, studio.grid = look.width, look.height, look.samples
    studio.occlusion_rays = look.occlusion_rays
    studio.lights = wp.array(records, dtype=Light, device=device)
    studio.light_count, studio.softness = len(records), 0.09
    studio.sky = wp.vec3(*(lights.ambient * 1.25))
    studio.ground = wp.vec3(*(lights.ambient * style.ground))
    studio.zenith = wp.vec3(*drawables.up)
    across = window[0] if view.orthographic else window[0] * view.focus
    studio.occlusion_reach = 0.07 * across
    studio.centre, studio.fade = wp.vec3(0.0, 0.0, 0.0), 0.85 * across
    studio.spacing = nice_length(across / 12.0) if look.grid else 0.0
    studio.middle, studio.edge = wp.vec3(*style.middle), wp.vec3(*style.edge)
    return Uploaded(world, studio, keep)
