"""What a data set will cost, from a few source points of one pose."""

from __future__ import annotations

import time
from dataclasses import dataclass

from otwarp.vision.datasets.labels import Labels
from otwarp.vision.datasets.shots import exposed_pose
from otwarp.vision.fourier import Fourier

PROBE = 2
"""Rings of source points that are timed: of 19."""


@dataclass(frozen=True)
class Plan:
    """Of a data set, before it is made.

    Attributes:
        poses, images: How many.
        sources: Points of the condenser, all wavelengths together.
        bytes: Of images, before they are compressed.
        pose_seconds, image_seconds: About what light's way through a pose takes on one processor, and what a look does.
    """

    poses: int
    images: int
    sources: int
    bytes: int
    pose_seconds: float
    image_seconds: float

    def seconds(self, processes: int = 1) -> float:
        """About what all of it takes."""
        return (self.poses * self.pose_seconds + self.images * self.image_seconds) / max(1, min(processes, self.poses))


def plan_of(labels: Labels, device: str | None = None) -> Plan:
    """Time a pose and some looks at it with few source points; kernels are compiled before.

    Raises:
        InputError: No such device.
    """
    fourier, spec = Fourier(device), labels.spec
    coherent = spec.microscope.condenser_aperture <= 0.0
    sources = 1 if coherent else 1 + 3 * spec.rendering.rings * (spec.rendering.rings + 1)
    sources *= len(spec.microscope.lines())
    exposed_pose(labels, 0, fourier, rings=1).images([0.0])
    begun = time.perf_counter()
    exposed = exposed_pose(labels, 0, fourier, rings=PROBE)
    led = time.perf_counter()
    exposed.images([0.0, 1.0])
    looked = time.perf_counter()
    share = sources / sum(len(light.weights) for _, light, _, _ in exposed.parts)
    return Plan(
        poses=labels.poses,
        images=labels.count,
        sources=sources,
        bytes=labels.count * spec.width * spec.height,
        pose_seconds=(led - begun) * share,
        image_seconds=0.5 * (looked - led) * share,
    )
