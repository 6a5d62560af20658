"""Where a window looks from, and how large things are in it: presets of the camera, scale bar, legend."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from otwarp.record.monitor import can_touch
from otwarp.scene import Scene
from otwarp.teleop.page.protocol import CameraDrawing, Colour, Drawing, PageFrame
from otwarp.teleop.page.scene_view import ARROW_COLOURS

PRESETS = ("stage", "top", "front", "side", "close")
"""Where a window may look from; digits 1, 2, … choose them."""
BAR = 120.0
"""Width that a scale bar has about [pixels]."""
MARGIN = 1.15
"""Of what is in view around the bodies."""
MOST_NAMED = 8
"""Bodies that the legend names."""
TILT = 1e-3
"""By how much the view from above is off the vertical: a camera whose up is its way of looking spins."""


@dataclass(frozen=True, slots=True)
class Look:
    """Place of a camera, and the place that it looks at [µm]."""

    position: tuple[float, float, float]
    look_at: tuple[float, float, float]


def preset(name: str, drawing: Drawing, frame: PageFrame, aspect: float = 1.0) -> Look:
    """Where to look from.

    Args:
        name: One of `PRESETS`: as the stage's camera does, from above, from the front (along +y), from the right
            (along −x), or `close`, as the stage's camera but with robots, or else bodies, filling the view.
        drawing: What is shown.
        frame: Where it is.
        aspect: Width of the view over its height.
    """
    camera = drawing.camera
    if name == "stage":
        return Look(camera.position, camera.look_at)
    many = drawing.robots if name == "close" and drawing.robots.any() else np.ones(len(drawing.names), dtype=bool)
    middle, reach = _ball(drawing, frame, many)
    half = 0.5 * camera.fov
    far = MARGIN * reach / math.sin(min(half, math.atan(math.tan(half) * aspect)))
    toward = {
        "top": np.array([0.0, -TILT, 1.0]),
        "front": np.array([0.0, -1.0, 0.0]),
        "side": np.array([1.0, 0.0, 0.0]),
        "close": np.subtract(camera.position, camera.look_at),
    }[name]
    place = middle + far * toward / np.linalg.norm(toward)
    return Look(
        (float(place[0]), float(place[1]), float(place[2])), (float(middle[0]), float(middle[1]), float(middle[2]))
    )


def _ball(drawing: Drawing, frame: PageFrame, chosen: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre and radius of a ball around bodies; around what the stage's camera looks at, without any."""
    places = np.asarray(frame.position, dtype=float)[chosen]
    places = places[np.isfinite(places).all(axis=1)]
    camera = drawing.camera
    if not len(places):
        return np.array(camera.look_at), math.dist(camera.position, camera.look_at) * math.tan(0.5 * camera.fov)
    middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
    size = float(np.max(drawing.touching[1][chosen], initial=1.0))
    return middle, float(np.linalg.norm(places - middle, axis=1).max()) + 2.0 * size


def pixels_per_micrometre(camera: CameraDrawing | Look, fov: float, height: float) -> float:
    """Of the plane through the place that is looked at, across the view.

    Args:
        camera: Where it is.
        fov: Vertical field of view [rad].
        height: Of the view [pixels].
    """
    distance = max(math.dist(camera.position, camera.look_at), 1e-12)
    return height / (2.0 * math.tan(0.5 * fov) * distance)


def round_length(pixels_per_unit: float, wanted: float = BAR) -> float:
    """The largest of 1, 2, 5, 10, … µm, and parts of them, whose bar is at most as wide as wanted [pixels]."""
    most = wanted / pixels_per_unit
    power = 10.0 ** math.floor(math.log10(most))
    return max(k * power for k in (1.0, 2.0, 5.0) if k * power <= most * (1.0 + 1e-9))


def length_text(micrometres: float) -> str:
    """A length with the unit that suits it."""
    if micrometres < 0.999:
        return f"{1e3 * micrometres:.4g} nm"
    return f"{micrometres:.4g} µm" if micrometres < 999.9 else f"{1e-3 * micrometres:.4g} mm"


def legend(scene: Scene, drawing: Drawing, arrows: float, other: str | None = None) -> str:
    """What colours mean, as HTML.

    Args:
        scene: What is shown.
        drawing: As it is drawn.
        arrows: Length of forces [µm/pN].
        other: Name of a second run that is drawn translucent, None for none.
    """
    rows: list[tuple[Colour, str]] = []
    bodies = {b.index: b.parts[0].colour for b in drawing.bodies if b.parts}
    named = [i for i in bodies if drawing.robots[i]][:MOST_NAMED]
    rows += [(bodies[i], drawing.names[i]) for i in named]
    cells = [g for g in drawing.balls if len(g.bodies)]
    for group in cells[:2]:
        count = len(group.bodies)
        name = drawing.names[group.bodies[0]] if count == 1 else f"{count:,} bodies"
        rows.append((_colour(group.colours[0]), name))
    hands: dict[str, Colour] = {}
    for trap in drawing.traps:
        hands.setdefault({"none": "trap"}.get(trap.hand, f"trap, {trap.hand} hand"), trap.colour)
    rows += [(colour, name) for name, colour in hands.items()]
    if scene.traps:
        rows.append((ARROW_COLOURS[0], "force of a trap"))
    if can_touch(scene):
        rows.append((ARROW_COLOURS[1], "contact force"))
    text = "".join(
        f'<div><span class="swatch" style="background:rgb{colour}"></span>{html.escape(name)}</div>'
        for colour, name in rows
    )
    text += f'<div class="quiet">arrows: {length_text(arrows)} per pN</div>'
    if other is not None:
        text += f'<div class="quiet">translucent: {html.escape(other)}</div>'
    return text


def _colour(row: Sequence[int] | np.ndarray) -> Colour:
    r, g, b = (int(v) for v in row)
    return r, g, b
