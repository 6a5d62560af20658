"""Images as observations: what the microscope of a scene records of worlds, about the robot that is controlled."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from otwarp.envs.actions import is_tensor
from otwarp.envs.batch import Batch
from otwarp.envs.task import Task
from otwarp.errors import InputError
from otwarp.scene import Camera, Scene
from otwarp.scene.transforms import conjugate, rotate

TOGETHER = 256
"""Most worlds whose images are computed at once, for which there must be memory."""
CONTRAST = 1e-6
"""Least difference of refractive indices that counts as one."""


class Images:
    """The microscope of each world of a batch, as its observations have it.

    Noise goes by the number of the trial and of the period: environment i of seed s sees what environment 0 of seed
    s + i sees, grey level by grey level.

    Args:
        batch: The worlds, of a task whose `observation` is `image` or `both`.

    Raises:
        InputError: Nothing in the scene refracts, its camera cannot be, or a GPU without torch.
    """

    def __init__(self, batch: Batch):
        from otwarp.perception.photographer import Photographer

        task, scene = batch.task, batch.scene
        check_refracts(task, scene)
        self.batch = batch
        self.body = followed_body(batch)
        self.camera = camera_for(scene, self.body)
        self._photographer = Photographer(dataclasses.replace(scene, camera=self.camera), device=str(batch.device))
        width, height = task.image_size
        self.levels = np.zeros((batch.worlds, height, width, 1), dtype=np.uint8)

    def record(self, chosen: np.ndarray | None = None) -> None:
        """Take images of worlds as they are, black ones of states that are no numbers; a GPU takes `TOGETHER` at once.

        Args:
            chosen: (W) bool; None for all.
        """
        batch = self.batch
        position, orientation = batch.sim.prim_poses()
        trial, period = batch.episode.number.numpy(), batch.episode.period.numpy()
        wanted = np.ones(batch.worlds, dtype=bool) if chosen is None else chosen
        there = np.isfinite(position).all(axis=(1, 2)) & np.isfinite(orientation).all(axis=(1, 2))
        self.levels[wanted & ~there] = 0
        wanted = np.flatnonzero(wanted & there)
        for first in range(0, len(wanted), TOGETHER):
            some = wanted[first : first + TOGETHER]
            regions = [self._region(place) for place in position[some, self.body]]
            numbers = [(int(trial[n]) << 32) + int(period[n]) for n in some]
            grey = self._photographer.worlds(position[some], orientation[some], regions, numbers)
            self.levels[some, :, :, 0] = self._binned(grey)

    def observed(self, state: Any) -> Any:
        """What worlds show: (W, height, width, 1) images, or these beside the (W, O) state.

        They are tensors where the state is one, on its device: of a CPU on the memory of the images, else copied there.
        """
        levels = tensor_beside(state, self.levels) if is_tensor(state) else self.levels.copy()
        return levels if self.batch.task.observation == "image" else {"image": levels, "state": state}

    def _region(self, body: np.ndarray) -> Any:
        """The `Region` that is observed while the body that is followed is at (3) [µm]."""
        from otwarp.perception.camera import Region

        task, camera, frame = self.batch.task, self.camera, self._photographer.size
        width, height = (task.image_binning * side for side in task.image_size)
        middle = np.zeros(2)
        if task.image_follows:
            place = rotate(conjugate(np.array(camera.orientation)), body)
            middle = place[:2] - np.array(camera.center)
        column, row = (round(x / camera.pixel_size) + side // 2 for x, side in zip(middle, frame, strict=True))
        return Region(column - width // 2, row - height // 2, width, height)

    def _binned(self, grey: np.ndarray) -> np.ndarray:
        """(n, height, width) uint8 of the camera's (n, rows, columns), row 0 the highest."""
        k, (count, height, width) = self.batch.task.image_binning, grey.shape
        mean = grey.reshape(count, height // k, k, width // k, k).mean(axis=(2, 4))
        return np.rint(mean[:, ::-1]).astype(np.uint8)


def images_of(batch: Batch) -> Images | None:
    """Images, where the observations of the task have them."""
    return None if batch.task.observation == "state" else Images(batch)


def only(seen: Any, chosen: np.ndarray) -> Any:
    """Observations of worlds, those of the others zero."""
    if isinstance(seen, dict):
        return {name: only(values, chosen) for name, values in seen.items()}
    if is_tensor(seen):
        return seen * tensor_beside(seen, chosen).reshape(-1, *[1] * (seen.ndim - 1))
    return np.where(chosen.reshape(-1, *[1] * (seen.ndim - 1)), seen, np.zeros_like(seen))


def tensor_beside(other: Any, values: np.ndarray) -> Any:
    """An array as a tensor of torch, on the device of another one."""
    import torch

    return torch.from_numpy(values).to(other.device)


def check_refracts(task: Task, scene: Scene) -> None:
    """Refuse a scene whose images would be empty.

    Raises:
        InputError: No body has another refractive index than the medium.
    """
    medium = scene.medium.refractive_index
    indices = [s.refractive_index for body in scene.bodies for s in body.spheres]
    indices += [r.refractive_index for body in scene.bodies for r in body.rods if r.refractive_index is not None]
    if not any(abs(index - medium) > CONTRAST for index in indices):
        raise InputError(f"observation of task {task.name} is {task.observation!r}, but no body has another refractive "
                         f"index than the medium, {medium:g}; allowed: state")  # fmt: skip


def followed_body(batch: Batch) -> int:
    """Index of the body that the hands hold: that of the first of their traps that holds one, else the first."""
    held = batch.place.held_body.numpy()
    traps = [trap.prim for trap in batch.scene.traps]
    bodies = [int(held[traps.index(prim)]) for hand in batch.task.hands for prim in hand.traps]
    return next((body for body in bodies if body >= 0), 0)


def camera_for(scene: Scene, body: int) -> Camera:
    """The camera of a scene, with grey levels of eight bits at most; else one that looks at a body where it starts."""
    if scene.camera is not None:
        return dataclasses.replace(scene.camera, bits=min(scene.camera.bits, 8))
    x, y, z = (float(v) for v in scene.bodies[body].position)
    return Camera(prim=f"{scene.root}/camera", center=(x, y), focus=z)
