"""`Photographer`: what the microscope of a scene records of regions of its frame, whatever bodies reach into them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from otwarp.perception.camera import Piece, Region
from otwarp.scene import Scene
from otwarp.vision.fourier import Fourier
from otwarp.vision.rendering import Rendering, expose
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
        pixel = self._camera.pixel_size
        found = []
        for n, region in enumerate(regions):
            column, row = region.middle
            x, y = (column - self.size[0] // 2) * pixel, (row - self.size[1] // 2) * pixel
            light = np.mean([self._light(s.moved([-x, -y, 0.0]), region) for s in specimens], axis=0)
            levels = self._sensor.levels(light, seed=self._seed, image=16 * number + n)
            found.append(Piece(region.left, region.low, levels))
        return tuple(found)

    def _light(self, specimen: Specimen, region: Region) -> np.ndarray:
        """(height, width) intensity of a region whose middle is on the optical axis."""
        half = 0.5 * self._microscope.pixel * np.array([region.width, region.height])
        low, high = specimen.boxes()
        near = np.all((high[:, :2] > -half - NEAR) & (low[:, :2] < half + NEAR), axis=1)
        seen, focus = specimen.some(np.flatnonzero(near)), [self._camera.focus]
        # solids that the region cuts are computed whole
        reach = float(np.maximum(np.abs(low[near, :2]), np.abs(high[near, :2])).max(initial=0.0))
        margin = max(MARGIN, float(math.ceil(reach - float(half.max()) + 0.2)))
        how = dataclasses.replace(self._how, margin=margin)
        size = region.width, region.height
        exposed = expose(seen, self._microscope, *size, focus=focus, rendering=how, fourier=self._fourier)
        return exposed.images(focus)[0]
