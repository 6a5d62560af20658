"""`Photographer`: what the microscope of a scene records of regions of its frame, whatever bodies reach into them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from otwarp.perception.camera import Piece, Region
from otwarp.scene import Scene
from otwarp.vision.fourier import Fourier
from otwarp.vision.rendering import Rendering, expose, render_many
from otwarp.vision.specimen import Specimen
from otwarp.vision.view import camera_of, image_size, microscope_of, sensor_of, specimen_of

MARGIN = 2.0
"""Around a region, at least [µm]; more where a solid that it cuts reaches farther."""

LIVE = Rendering(rings=1, thickness=0.5, margin=MARGIN)
"""How images are computed where a session waits for them: 7 points of the condenser, few slices."""

NEAR = 0.5
"""Distance beyond a region from which on solids are left out [µm]."""


class Photographer:
    """The camera of a scene, pointed at regions.

    Args:
        scene: With camera and bodies.
        rendering: How.
        device: On what.
        seed: Of the sensor's noise.

    Raises:
        InputError: The scene has no camera, or one that cannot be.
    """

    def __init__(self, scene: Scene, *, rendering: Rendering = LIVE, device: str | None = None, seed: int = 0):
        self._scene, self._how, self._seed = scene, rendering, seed
        self._camera, self._microscope, self._sensor = camera_of(scene), microscope_of(scene), sensor_of(scene)
        self._fourier = Fourier(device)
        self.size = image_size(self._camera)

    def pieces(
        self, position: np.ndarray, orientation: np.ndarray, regions: Sequence[Region], number: int
    ) -> tuple[Piece, ...]:
        """Grey levels of regions.

        Args:
            position: (e, B, 3) of the bodies' prims at the moments of the exposure, which are averaged [µm].
            orientation: (e, B, 4) likewise.
            regions: Which.
            number: Of the exposure; a key of the noise.
        """
        specimens = [specimen_of(self._scene, p, q) for p, q in zip(position, orientation, strict=True)]
        found = []
        for n, region in enumerate(regions):
            light = np.mean([self._light(s.moved(-self._middle(region)), region) for s in specimens], axis=0)
            levels = self._sensor.levels(light, seed=self._seed, image=16 * number + n)
            found.append(Piece(region.left, region.low, levels))
        return tuple(found)

    def worlds(
        self, position: np.ndarray, orientation: np.ndarray, regions: Sequence[Region], numbers: Sequence[int]
    ) -> np.ndarray:
        """(W, height, width) grey levels of a region of each of many worlds, as `pieces` has them one by one.

        A GPU computes them together.

        Args:
            position: (W, B, 3) of the bodies' prims [µm].
            orientation: (W, B, 4) likewise.
            regions: (W) of the same size.
            numbers: (W) of the exposures; keys of the noise.
        """
        seen, margins = [], []
        for p, q, region in zip(position, orientation, regions, strict=True):
            specimen, margin = self._near(specimen_of(self._scene, p, q).moved(-self._middle(region)), region)
            seen.append(specimen)
            margins.append(margin)
        light, size = np.zeros((len(seen), regions[0].height, regions[0].width)), (regions[0].width, regions[0].height)
        for margin in dict.fromkeys(margins):
            some = [n for n, m in enumerate(margins) if m == margin]
            how = dataclasses.replace(self._how, margin=margin)
            images = render_many([seen[n] for n in some], self._microscope, *size, focus=[self._camera.focus],
                                 rendering=how, fourier=self._fourier)  # fmt: skip
            light[some] = images[:, 0]
        record = partial(self._sensor.levels, seed=self._seed)
        return np.stack([record(one, image=16 * n) for one, n in zip(light, numbers, strict=True)])

    def _middle(self, region: Region) -> np.ndarray:
        """(3) the middle of a region in the frame of the camera, at height 0 [µm]."""
        pixel, (column, row) = self._camera.pixel_size, region.middle
        return np.array([(column - self.size[0] // 2) * pixel, (row - self.size[1] // 2) * pixel, 0.0])

    def _near(self, specimen: Specimen, region: Region) -> tuple[Specimen, float]:
        """Solids that a region shows whose middle is on the optical axis, and the margin they need [µm]."""
        half = 0.5 * self._microscope.pixel * np.array([region.width, region.height])
        low, high = specimen.boxes()
        near = np.all((high[:, :2] > -half - NEAR) & (low[:, :2] < half + NEAR), axis=1)
        # solids that the region cuts are computed whole
        reach = float(np.maximum(np.abs(low[near, :2]), np.abs(high[near, :2])).max(initial=0.0))
        margin = max(MARGIN, float(math.ceil(reach - float(half.max()) + 0.2)))
        return specimen.some(np.flatnonzero(near)), margin

    def _light(self, specimen: Specimen, region: Region) -> np.ndarray:
        """(height, width) intensity of a region whose middle is on the optical axis."""
        seen, margin = self._near(specimen, region)
        how, focus = dataclasses.replace(self._how, margin=margin), [self._camera.focus]
        size = region.width, region.height
        exposed = expose(seen, self._microscope, *size, focus=focus, rendering=how, fourier=self._fourier)
        return exposed.images(focus)[0]
