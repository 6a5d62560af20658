"""What looks at the pieces of each body: templates of what it may do, or a trained network that was made for it."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from otwarp import cache
from otwarp.cache import cache_folder
from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.scene.transforms import rotation_matrix
from otwarp.vision.networks.run import Estimator as Network
from otwarp.vision.rendering import Rendering
from otwarp.vision.tracking.commands import Commands
from otwarp.vision.tracking.matching import Matcher, TemplateErrors
from otwarp.vision.tracking.recorded import RecordedBody, in_camera
from otwarp.vision.tracking.rotations import exponential, product
from otwarp.vision.tracking.shape import Shape
from otwarp.vision.tracking.source import NetworkSource, TemplateSource, network_for, template_source
from otwarp.vision.tracking.templates import Templates, posed
from otwarp.vision.view import camera_of, microscope_of, sensor_of, solids_of

FRINGES = 1.0
"""What is seen of a body around it [µm]."""

DEPTHS, TILTS = 1.5, math.radians(12.0)
"""How far templates go above and below where a scene starts a body [µm], and to both sides of its tilt there [rad]."""

BALLS = 2.0
"""By how much templates of a ball go farther."""

VERSION = 3
"""Of templates on disk: raise it with any change of what they are."""


def piece_size(scene: Scene, index: int) -> int:
    """Side of the pieces in which a body is looked for [pixels]: it may turn about the light, and has fringes."""
    body = scene.bodies[index]
    ends = [(np.array(end), radius) for start, last, radius, _ in solids_of(body) for end in (start, last)]
    low = np.min([end - r for end, r in ends], axis=0)
    high = np.max([end + r for end, r in ends], axis=0)
    reach = 0.5 * float(np.max(high - low)) + FRINGES
    return 8 * math.ceil(2.0 * reach / camera_of(scene).pixel_size / 8.0)


def templates_of(
    scene: Scene,
    index: int,
    size: int,
    *,
    rendering: Rendering,
    depths: float = DEPTHS,
    tilts: float = TILTS,
    device: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> TemplateSource:
    """Templates of a body about where its scene starts it.

    Args:
        scene: With camera and body.
        index: Of the body.
        size: Side of its pieces [pixels].
        rendering: How.
        depths: How far they go above and below [µm].
        tilts: How far they go to both sides of how it lies [rad].
        device: Where.
        progress: Told how many tilts are done, of how many.

    Raises:
        InputError: Too many templates.
    """
    body, shape = scene.bodies[index], Shape.of(scene, scene.bodies[index].name, np.zeros(3))
    if not np.any(shape.axis):
        depths *= BALLS  # one tilt: deeper templates cost little, and what no trap holds goes far
    about = _described(scene, index, shape, {"size": size, "depths": depths, "tilts": tilts}, rendering)
    if (kept := _kept(scene, about)) is not None:
        return kept
    places, turns = [], []
    side = _side(scene, index, shape)
    for height, lean in ((0.0, 0.0), (depths, tilts), (-depths, -tilts)):
        turn = np.array(body.orientation) if side is None else product(exponential(lean * side), body.orientation)
        places.append(np.array(body.position) + height * rotation_matrix(np.array(camera_of(scene).orientation))[:, 2])
        turns.append(turn)
    count = len(scene.bodies)
    position, orientation = np.zeros((3, count, 3)), np.zeros((3, count, 4))
    position[:, index], orientation[:, index] = places, turns
    orientation[..., 3] += ~np.any(orientation, axis=-1)
    gone = RecordedBody(scene=scene, body=body.name, index=index, time=np.arange(3.0), position=position,
                        orientation=orientation, commands=Commands.of_scene(scene))  # fmt: skip
    found = template_source(gone, size, rendering=rendering, device=device, progress=progress)
    t = found.matcher.templates
    flags = np.array([t.ball, t.reversible])
    errors = {f"errors_{name}": values for name, values in vars(found.matcher.errors).items()}
    arrays = {"tilt": t.tilt, "depth": t.depth, "splines": t.splines, "flags": flags, **errors}
    cache.save(cache_folder() / "templates", about, arrays)
    return found


def _described(scene: Scene, index: int, shape: Shape, limits: dict[str, float], rendering: Rendering) -> str:
    """What templates hold for: how the body lies and is lit, how it is rendered, and how far they go."""
    body, camera = scene.bodies[index], camera_of(scene)
    at, frame = in_camera(camera, np.array(body.position), np.array(body.orientation))
    still = posed(scene, body.name, shape, 0.0)
    solids = np.column_stack([still.start, still.end, still.radius, still.index])
    depth = float((at + frame @ (shape.arm - shape.origin))[2])
    lean = math.asin(float(np.clip((frame @ shape.axis)[2], -1.0, 1.0)))
    said = {
        "version": VERSION, "solids": np.round(solids, 9).tolist(), "depth": round(depth, 9), "tilt": round(lean, 9),
        "microscope": dataclasses.asdict(microscope_of(scene)), "sensor": dataclasses.asdict(sensor_of(scene)),
        "rendering": dataclasses.asdict(rendering), **limits,
    }  # fmt: skip
    return json.dumps(said, sort_keys=True)


def _kept(scene: Scene, about: str) -> TemplateSource | None:
    """Templates that were rendered before."""
    arrays = cache.load(cache_folder() / "templates", about)
    if arrays is None:
        return None
    ball, reversible = (bool(v) for v in arrays["flags"])
    tilt, depth, splines = (arrays[name] for name in ("tilt", "depth", "splines"))
    pixel, sensor = camera_of(scene).pixel_size, sensor_of(scene)
    templates = Templates(tilt, depth, splines, pixel, sensor, ball, reversible)
    errors = TemplateErrors(*(arrays[f"errors_{field.name}"] for field in dataclasses.fields(TemplateErrors)))
    return TemplateSource(Matcher(templates, errors))


def _side(scene: Scene, index: int, shape: Shape) -> np.ndarray | None:
    """(3) axis about which a body's tilt out of the focal plane grows; None for a ball."""
    if not np.any(shape.axis):
        return None
    normal = rotation_matrix(np.array(camera_of(scene).orientation))[:, 2]
    side = np.cross(rotation_matrix(np.array(scene.bodies[index].orientation)) @ shape.axis, normal)
    length = float(np.linalg.norm(side))
    return side / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])


def network_of(scene: Scene, index: int, net: Network, path: str | Path, *, any_robot: bool = False) -> NetworkSource:
    """A network for a body of the scene.

    Args:
        scene: With camera and body.
        index: Of the body.
        net: Of `otwarp.vision.networks.load`.
        path: Where it was loaded from, for what is said.
        any_robot: Whether it may be that of another robot.

    Raises:
        InputError: It takes other pixels, does not say where the body is, or learnt to see another robot.

    Warns:
        PlausibilityWarning: The scene starts the body in a pose, or has optics, that the network has not learnt.
    """
    missing = [name for name in ("x", "y", "depth") if name not in net.targets.names]
    if net.about.get("heads") == "paper" or missing:
        what = "classes and normalised depth alone" if net.about.get("heads") == "paper" else f"no {missing[0]}"
        raise InputError(f"--perception {path} says {what}; allowed: heads pose or both, of x, y and depth at least")
    body = scene.bodies[index]
    shape = Shape.of(scene, body.name, np.zeros(3))
    at, frame = in_camera(camera_of(scene), np.array(body.position), np.array(body.orientation))
    axis = frame @ shape.axis
    depth = float((at + frame @ (shape.arm - shape.origin))[2])
    start = np.array([[depth, math.asin(float(np.clip(axis[2], -1.0, 1.0))), math.atan2(axis[1], axis[0])]])
    return network_for(scene, body.name, net, start, who=f"--perception {path}", any_robot=any_robot, turn_always=False)
