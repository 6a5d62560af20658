"""Pictures of environments: the stage of a task's scene, with what has moved where it is."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from otwarp.envs.batch import Batch
from otwarp.errors import InputError, PlausibilityWarning
from otwarp.preview.annotate import annotate
from otwarp.preview.render import render
from otwarp.preview.studio import PictureStyle
from otwarp.scene.drawing.draw_list import SPHERE, Drawables
from otwarp.scene.drawing.parts import Drawn, read_drawn
from otwarp.scene.drawing.unlike import unlike_file
from otwarp.scene.transforms import rotation_matrix

GOAL_COLOUR, GOAL_RADIUS = (0.10, 0.85, 0.30), 1.0
"""Of a goal that the stage does not draw; its radius is in µm."""
ROUGHNESS = 0.4
"""Of everything drawn: neither a mirror nor chalk."""


class Picture:
    """Draws worlds of a batch.

    Args:
        batch: The worlds.
        size: Width and height in pixels.

    Raises:
        InputError: The scene was not read from a file, so that nothing says what it looks like.
    """

    def __init__(self, batch: Batch, size: tuple[int, int] = (480, 360)):
        scene = batch.scene
        if scene.file is None or not scene.file.is_file():
            raise InputError(f"scene of {batch.task.name} has no file, which says what it looks like; "
                             "allowed: a task whose scene is one")  # fmt: skip
        if other := unlike_file(scene):
            warnings.warn(f"pictures of {batch.task.name} have {other}", PlausibilityWarning, stacklevel=2)
        self.batch = batch
        self.look = PictureStyle(width=size[0], height=size[1], samples=2, occlusion_rays=0)
        traps = [trap.prim for trap in scene.traps]
        goal = [scene.goal.prim] if scene.goal else []
        owners = {*traps, *goal, *(b.prim for b in scene.bodies), *(o.prim for o in scene.obstacles)}
        self._drawn, self._view = read_drawn(scene.file, owners, traps, scene.overrides)
        model = batch.sim.model
        start = model.start_position(), model.start_orientation()
        prims = model.prim_position(*start)
        self._still = {b.prim: _inverse(_matrix(p, q)) for b, p, q in zip(scene.bodies, prims, start[1], strict=True)}
        self._still |= {t.prim: _inverse(_matrix(t.position.at(0.0))) for t in scene.traps}
        self._still |= {o.prim: _inverse(_matrix(o.position.at(0.0), o.orientation.at(0.0))) for o in scene.obstacles}
        if scene.goal:
            self._still[scene.goal.prim] = _inverse(_matrix(np.array(scene.goal.position)))

    def draw(self, world: int, *, annotated: bool = False) -> np.ndarray:
        """(height, width, 3) uint8 of a world as it is.

        Args:
            world: Which.
            annotated: With scale bar and time of the episode.
        """
        image = render(self._drawables(world), self.look, str(self.batch.device))
        if not annotated:
            return image
        pixel_size = self._view.pixel_size(self.look.width, self.look.height)
        return annotate(image, pixel_size=pixel_size, time=self._time(world))

    def _time(self, world: int) -> float:
        """Since the episode of a world began [s]."""
        return float(self.batch.episode.period.numpy()[world]) / self.batch.task.rate

    def _now(self, world: int) -> dict[str, np.ndarray]:
        """(4, 4) pose of everything that may have moved, by prim."""
        batch, scene = self.batch, self.batch.scene
        position, orientation = (rows[world] for rows in batch.sim.prim_poses())
        found = {b.prim: _matrix(p, q) for b, p, q in zip(scene.bodies, position, orientation, strict=True)}
        focus = batch.episode.focus.numpy()[world]
        found |= {t.prim: _matrix(p) for t, p in zip(scene.traps, focus, strict=True)}
        time = self._time(world)
        found |= {o.prim: _matrix(o.position.at(time), _unit(o.orientation.at(time))) for o in scene.obstacles}
        if scene.goal:
            found[scene.goal.prim] = _matrix(batch.episode.goal.numpy()[world])
        return found

    def _drawables(self, world: int) -> Drawables:
        """Everything visible."""
        scene, now = self.batch.scene, self._now(world)
        lights = {t.prim for t in scene.traps}
        parts: list[tuple[Drawn, np.ndarray, bool]] = []
        for owner, drawn in self._drawn.items():
            move = now[owner] @ self._still[owner] if owner in now else np.eye(4)
            parts += [(d, move @ d.transform, owner in lights) for d in drawn]
        if scene.goal is None and self.batch.task.goal is not None:
            ball = _matrix(self.batch.episode.goal.numpy()[world]) @ np.diag([*[GOAL_RADIUS] * 3, 1.0])
            colour, opacity = np.array([GOAL_COLOUR]), np.array([0.3])
            drawn = Drawn(kind=SPHERE, transform=ball[None], size=(0.0, 0.0), colour=colour, opacity=opacity)
            parts.append((drawn, ball[None], False))
        counts = [len(d.transform) for d, _, _ in parts]
        meshes = [d.mesh for d, _, _ in parts if d.mesh is not None]
        index = iter(range(len(meshes)))

        def repeated(values: list[Any]) -> np.ndarray:
            return np.repeat(np.array(values), counts, axis=0)

        return Drawables(
            kind=repeated([d.kind for d, _, _ in parts]).astype(np.int32),
            transform=np.concatenate([transform for _, transform, _ in parts]),
            size=repeated([d.size for d, _, _ in parts]),
            colour=np.concatenate([d.colour for d, _, _ in parts]),
            opacity=np.concatenate([d.opacity for d, _, _ in parts]),
            roughness=np.full(sum(counts), ROUGHNESS),
            beam=repeated([beam for _, _, beam in parts]),
            mesh=repeated([-1 if d.mesh is None else next(index) for d, _, _ in parts]).astype(np.int32),
            meshes=tuple(meshes),
            view=self._view,
        )


def _matrix(place: np.ndarray, turn: np.ndarray | None = None) -> np.ndarray:
    """(4, 4) of a place [µm] and an orientation."""
    matrix = np.eye(4)
    matrix[:3, 3] = place
    if turn is not None:
        matrix[:3, :3] = rotation_matrix(turn)
    return matrix


def _unit(turn: np.ndarray) -> np.ndarray:
    return turn / np.linalg.norm(turn)


def _inverse(matrix: np.ndarray) -> np.ndarray:
    return np.linalg.inv(matrix)
