"""What a data set will cost, from a few source points of one pose."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from otwarp.vision.datasets.labels import Labels
from otwarp.vision.datasets.shots import exposed_pose, lights_of_pose, reaches_of
from otwarp.vision.fourier import Fourier

PROBE = 2
"""Rings of source points that are timed: of 19."""


@dataclass(frozen=True)
class Plan:
    """Of a data set, before it is made.

    Attributes:
        poses, images: How many.
        sources: Points of the condenser, all wavelengths together, of the first pose.
        margin: Around the image [µm].
        bytes: Of images, before they are compressed.
        pose_seconds, image_seconds: About what light's way through a pose takes on one processor, and what a look does.
    """

    poses: int
    images: int
    sources: int
    margin: float
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
    lights = lights_of_pose(labels, 0)
    sources = sum(len(light.weights) for light in lights)
    depths = labels.arrays["depth"]
    # the sweep is looked at with fewer points in the middle than at its ends
    seen = np.mean([sum(len(light.enough(r).weights) for light in lights) for r in reaches_of(labels, depths)])
    exposed_pose(labels, 0, fourier, rings=1).images([0.0])
    clock = time.perf_counter if fourier.device.is_cuda else time.process_time  # of one processor, whoever else works
    begun = clock()
    exposed = exposed_pose(labels, 0, fourier, rings=PROBE)
    led = clock()
    exposed.images([0.0, 1.0])
    looked = clock()
    return Plan(
        poses=labels.poses,
        images=labels.count,
        sources=sources,
        bytes=labels.count * spec.width * spec.height,
        margin=exposed.margin,
        pose_seconds=(led - begun) * sources / exposed.sources,
        image_seconds=0.5 * (looked - led) * float(seen) / exposed.sources,
    )
