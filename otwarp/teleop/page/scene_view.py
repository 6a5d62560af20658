"""The scene in viser: robots, cells, obstacles, beams, traps, force arrows; and what changes of them with a frame.

A trap's arrow stands on the sphere it holds, a contact's on the part of the body that touches.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np

from otwarp.scene.transforms import rotate
from otwarp.teleop.page.compose import ball, beam
from otwarp.teleop.page.protocol import Colour, Drawing, MeshPart, PageFrame
from otwarp.teleop.page.viser_internals import instanced

if TYPE_CHECKING:
    import viser

SHORTEST = 0.25
"""Arrows shorter than this many head lengths are left out."""
MOST_CONTACTS = 200
"""Contacts that are drawn, the largest: thousands of arrows say less than none."""
WEAKEST = 1e-3
"""Force below which no arrow is drawn, however long it would be [pN]."""
BACKGROUND, LIGHT_BACKGROUND = ((22, 32, 48), (6, 9, 15)), ((255, 255, 255), (232, 238, 245))
"""Colours of the middle and the edge of the background, on the dark page and on the light one."""
FINE, MIDDLE = 400, 3000
"""Balls up to which each is drawn with 1280, and with 320 triangles; more get 80."""
MANY, MANY_INTERVAL = 2000, 0.1
"""From that many balls on they are moved at most once in that many seconds: each time is 120 kB to every window."""
FAINTEST, BRIGHTEST = 0.08, 0.5
"""Opacity of a beam without power, and at the largest power seen."""
SKY, KEY, FILL = 1.9, 2.2, 0.7
"""Strength of the light from all sides, of that from above on the left, and of that from the right."""
TRAP_RADIUS = 0.28
"""Radius of a trap's marker [µm]."""
ARROW_COLOURS = ((255, 201, 89), (255, 64, 92))
"""Of traps, and of contacts."""


def trap_arrows(drawing: Drawing, frame: PageFrame, scale: float, head: float) -> np.ndarray:
    """(n, 2, 3) start and end of the arrows of traps [µm].

    Args:
        drawing: What is shown.
        frame: Forces of T traps.
        scale: Length per force [µm/pN].
        head: Length of an arrow's head [µm].
    """
    if not drawing.traps:
        return np.zeros((0, 2, 3), dtype=np.float32)
    held = np.array([trap.held for trap in drawing.traps])
    offset = np.array([trap.offset for trap in drawing.traps])
    radius = np.array([trap.radius for trap in drawing.traps])
    body = np.maximum(held, 0)
    if len(frame.position):
        centre = frame.position[body] + rotate(_unit(frame.orientation[body]), offset)
        start = np.where((held >= 0)[:, None], centre, frame.trap_position)
    else:
        start = frame.trap_position
    return _arrows(start, frame.trap_force, radius, scale, head)


def contact_arrows(drawing: Drawing, frame: PageFrame, scale: float, head: float) -> np.ndarray:
    """(n, 2, 3) start and end of the arrows of contacts [µm]; arguments as `trap_arrows`."""
    if not len(frame.contact_force):
        return np.zeros((0, 2, 3), dtype=np.float32)
    size = np.linalg.norm(frame.contact_force, axis=1)
    chosen = np.flatnonzero(size > WEAKEST)
    if len(chosen) > MOST_CONTACTS:
        chosen = chosen[np.argsort(-size[chosen], kind="stable")[:MOST_CONTACTS]]
    centres, reach = drawing.touching
    start = frame.position[chosen] + rotate(_unit(frame.orientation[chosen]), centres[chosen])
    return _arrows(start, frame.contact_force[chosen], reach[chosen], scale, head)


def _arrows(start: np.ndarray, force: np.ndarray, radius: np.ndarray, scale: float, head: float) -> np.ndarray:
    """Arrows that begin where the ball about `start` ends; none for forces that are not finite or too small."""
    size = np.linalg.norm(force, axis=1)
    good = np.isfinite(size) & (size > WEAKEST) & (size * scale > SHORTEST * head) & np.isfinite(start).all(axis=1)
    direction = force[good] / size[good, None]
    a = start[good] + radius[good, None] * direction
    return np.stack([a, a + scale * force[good]], axis=1).astype(np.float32)


def _unit(q: np.ndarray) -> np.ndarray:
    q = np.asarray(q, dtype=float)
    return q / np.maximum(np.linalg.norm(q, axis=-1, keepdims=True), 1e-12)


def wxyz(q: np.ndarray) -> np.ndarray:
    """Quaternions (..., 4) in (x, y, z, w) → viser's (w, x, y, z), of length 1."""
    q = _unit(q)
    return np.concatenate([q[..., 3:], q[..., :3]], axis=-1)


class SceneView:
    """Everything drawn in 3-D; one thread.

    Args:
        server: Of viser.
        drawing: What is drawn.
        root: Path of all of it in viser's scene.
        studio: Whether camera, light and background are set up, too; not for a second scene beside the first.
        light: Whether the background is light.

    Attributes:
        arrow_scale: Length of force arrows [µm/pN].
        trap_forces, contact_forces, beams: Whether they are drawn.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        drawing: Drawing,
        *,
        root: str = "/scene",
        studio: bool = True,
        light: bool = False,
    ):
        self._server, self._drawing, self._root = server, drawing, root
        self.arrow_scale = 1.0
        self.trap_forces = self.contact_forces = self.beams = True
        camera = drawing.camera
        self._size = float(np.linalg.norm(np.subtract(camera.position, camera.look_at)))
        self._head = 0.011 * self._size
        self._brightest = max([trap.power for trap in drawing.traps], default=0.0)
        self._balls_at = -np.inf
        if studio:
            self._studio(light)
        scene = server.scene
        for k, part in enumerate(drawing.fixed):
            self._mesh(f"{root}/fixed_{k}", part)
        self._bodies = [self._frame(f"{root}/body_{b.index}", b.parts) for b in drawing.bodies]
        self._moving = [self._frame(f"{root}/obstacle_{k}", m.parts) for k, m in enumerate(drawing.moving)]
        self._balls = [self._group(k) for k in range(len(drawing.balls))]
        self._beams, self._marks = self._light()
        self._arrows = [
            scene.add_arrows(
                f"{root}/{name}",
                np.zeros((1, 2, 3), dtype=np.float32),
                instanced(np.array(colour)),
                shaft_radius=0.2 * self._head,
                head_radius=0.5 * self._head,
                head_length=self._head,
                visible=False,
            )
            for name, colour in zip(("trap_forces", "contact_forces"), ARROW_COLOURS, strict=True)
        ]

    def update(self, frame: PageFrame, now: float) -> None:
        """Put everything where a frame has it; `now` is on any clock [s]."""
        for b, handle in zip(self._drawing.bodies, self._bodies, strict=True):
            if np.isfinite(frame.position[b.index]).all() and np.isfinite(frame.orientation[b.index]).all():
                handle.position = frame.position[b.index]
                handle.wxyz = wxyz(frame.orientation[b.index])
        for moving, handle in zip(self._drawing.moving, self._moving, strict=True):
            position, orientation = moving.at(frame.time)
            handle.position, handle.wxyz = position, wxyz(orientation)
        many = sum(len(group.bodies) for group in self._drawing.balls)
        if many <= MANY or now - self._balls_at >= MANY_INTERVAL:
            self._balls_at = now
            for group, handle in zip(self._drawing.balls, self._balls, strict=True):
                place = np.nan_to_num(frame.position[group.bodies])
                if not np.array_equal(place, handle.batched_positions):
                    handle.batched_positions = place
        self._update_light(frame)
        self._update_arrows(frame)

    def _update_light(self, frame: PageFrame) -> None:
        if self._beams is None or self._marks is None:
            return
        place = np.nan_to_num(frame.trap_position)
        self._brightest = max(self._brightest, float(np.max(frame.trap_power, initial=0.0)))
        share = np.sqrt(np.clip(frame.trap_power / max(self._brightest, 1e-9), 0.0, 1.0))
        opacity = (FAINTEST + (BRIGHTEST - FAINTEST) * share).astype(np.float32)
        self._beams.visible = self.beams
        for handle in (self._beams, self._marks):
            if not np.array_equal(place, handle.batched_positions):
                handle.batched_positions = place
        if not np.array_equal(opacity, self._beams.batched_opacities):
            self._beams.batched_opacities = opacity

    def _update_arrows(self, frame: PageFrame) -> None:
        for handle, wanted, make in zip(
            self._arrows, (self.trap_forces, self.contact_forces), (trap_arrows, contact_arrows), strict=True
        ):
            points = make(self._drawing, frame, self.arrow_scale, self._head) if wanted else np.zeros((0, 2, 3))
            handle.visible = len(points) > 0
            if len(points):
                handle.points = cast("Any", points)  # it takes any floats, and keeps float32

    def _studio(self, light: bool) -> None:
        """Up, camera, light, background."""
        server, camera = self._server, self._drawing.camera
        server.scene.set_up_direction("+z")
        first = server.initial_camera
        first.position, first.look_at, first.up = camera.position, camera.look_at, (0.0, 0.0, 1.0)
        first.fov, first.near, first.far = camera.fov, camera.near, camera.far
        server.scene.world_axes.visible = False
        server.scene.configure_default_lights(enabled=False)
        # no environment map: to prepare one takes a machine without a graphics card some ten seconds
        server.scene.configure_environment_map(None)
        server.scene.add_light_hemisphere(
            "/light/sky", sky_color=(214, 226, 245), ground_color=(70, 80, 105), intensity=SKY
        )
        toward = np.subtract(camera.position, camera.look_at) / self._size
        right = np.cross([0.0, 0.0, 1.0], toward)
        for name, direction, strength in (
            ("key", 0.55 * toward + np.array([0.0, 0.0, 1.0]) - 0.8 * right, KEY),
            ("fill", 0.7 * toward + 0.9 * right, FILL),
        ):
            place = np.array(camera.look_at) + self._size * direction / np.linalg.norm(direction)
            server.scene.add_light_directional(f"/light/{name}", intensity=strength, position=tuple(place))
        server.scene.set_background_image(background(LIGHT_BACKGROUND if light else BACKGROUND), format="png")

    def _mesh(self, name: str, part: MeshPart) -> Any:
        clear = part.opacity < 1.0
        return self._server.scene.add_mesh_simple(
            name,
            part.vertices,
            part.faces,
            color=part.colour,
            opacity=part.opacity if clear else None,
            side="double" if clear else "front",
            cast_shadow=not clear,
            receive_shadow=not clear,
        )

    def _frame(self, name: str, parts: tuple[MeshPart, ...]) -> Any:
        """A frame without axes that carries its parts: a new pose is one message, not one per part."""
        frame = self._server.scene.add_frame(name, show_axes=False)
        for k, part in enumerate(parts):
            self._mesh(f"{name}/part_{k}", part)
        return frame

    def _group(self, k: int) -> Any:
        """Balls as instances of one mesh."""
        group, start = self._drawing.balls[k], self._drawing.position
        many = len(group.bodies)
        points, faces = ball(3 if many <= FINE else 2 if many <= MIDDLE else 1)
        return self._server.scene.add_batched_meshes_simple(
            f"{self._root}/balls_{k}",
            points,
            faces,
            batched_wxyzs=np.tile([1.0, 0.0, 0.0, 0.0], (many, 1)),
            batched_positions=start[group.bodies],
            batched_scales=group.radii.astype(np.float32),
            batched_colors=instanced(group.colours),
            opacity=group.opacity if group.opacity < 1.0 else None,
            lod="off",
            cast_shadow=many <= FINE,
            receive_shadow=many <= FINE,
        )

    def _light(self) -> tuple[Any, Any]:
        """Beams and markers of all traps, or None twice."""
        traps = self._drawing.traps
        if not traps:
            return None, None
        turn = wxyz(np.array([trap.orientation for trap in traps]))
        place = np.array([trap.position for trap in traps])
        colours = instanced(np.array([trap.colour for trap in traps]))
        points, faces = beam()
        beams = self._server.scene.add_batched_meshes_simple(
            f"{self._root}/beams",
            points,
            faces,
            batched_wxyzs=turn,
            batched_positions=place,
            batched_colors=colours,
            batched_opacities=np.full(len(traps), BRIGHTEST, dtype=np.float32),
            opacity=0.99,
            side="double",
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )
        points, faces = ball(2)
        marks = self._server.scene.add_batched_meshes_simple(
            f"{self._root}/traps",
            points,
            faces,
            batched_wxyzs=turn,
            batched_positions=place,
            batched_scales=np.full(len(traps), TRAP_RADIUS, dtype=np.float32),
            batched_colors=colours,
            lod="off",
            cast_shadow=False,
        )
        return beams, marks


def background(colours: tuple[Colour, Colour] = BACKGROUND, width: int = 480, height: int = 270) -> np.ndarray:
    """(height, width, 3) uint8: lighter in the middle, with half a level of noise so that it shows no bands."""
    y, x = np.mgrid[:height, :width]
    r = np.clip(np.hypot(2.0 * x / width - 1.0, 2.0 * y / height - 1.0) / 1.3, 0.0, 1.0)[..., None]
    t = r * r * (3.0 - 2.0 * r)
    colour = np.array(colours[0]) * (1.0 - t) + np.array(colours[1]) * t
    noise = np.modf(52.9829189 * np.modf(0.06711056 * x + 0.00583715 * y)[0])[0] - 0.5
    return np.clip(np.rint(colour + noise[..., None]), 0, 255).astype(np.uint8)
