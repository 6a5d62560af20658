"""`SimulatedCamera`: plant and microscope in the session's process, on whatever clock it has."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from otwarp.errors import InputError
from otwarp.perception.camera import CameraFrame, CameraInfo, Region
from otwarp.perception.photographer import Photographer
from otwarp.perception.plant import Plant

BLUR = 4
"""Moments of an exposure that are averaged."""


class SimulatedCamera:
    """A camera that looks at a plant, deterministic on a virtual clock.

    Frames are exposed at whole multiples of the period after `open`; only the latest is rendered, when it is read.

    Args:
        plant: What it looks at.
        photographer: The microscope.
        rate: Frames per second.
        exposure: [s].
        name: As the user named it.
        number: Of the last exposure before this camera was made.

    Raises:
        InputError: A rate or exposure out of range.
    """

    def __init__(
        self,
        plant: Plant,
        photographer: Photographer,
        *,
        rate: float = 100.0,
        exposure: float = 0.0,
        name: str = "top",
        number: int = 0,
    ):
        if not 0.1 <= rate <= 10_000.0:
            raise InputError(f"camera rate is {rate:g}; allowed: 0.1 to 10000 frames per second")
        if not 0.0 <= exposure * rate <= 1.0:
            raise InputError(f"exposure of the camera is {exposure:g} s; allowed: 0 to {1.0 / rate:g} s, a period")
        self.plant, self._photographer, self._period, self._exposure = plant, photographer, 1.0 / rate, exposure
        self._info = CameraInfo(name=name, kind="simulated", simulated=True)
        self._regions: tuple[Region, ...] = ()
        self._start, self._next, self._before, self._fresh = plant.time, 1, number, True
        self._exposed: tuple[int, np.ndarray, np.ndarray] | None = None

    @property
    def info(self) -> CameraInfo:
        """See `Camera`."""
        return self._info

    def open(self) -> None:
        """See `Camera`: the first command begins."""

    def aim(self, regions: Sequence[Region]) -> None:
        """See `Camera`."""
        self._regions = tuple(regions)

    def command(self, when: float, position: np.ndarray, power: np.ndarray) -> None:
        """Traps are told something, and the plant goes on to that time, exposing as it goes; see `Plant.follow`."""
        if self._fresh:
            # the first command says when the laboratory's time begins
            self.plant.begin(when)
            self._before += self._next - 1
            self._start, self._next, self._exposed, self._fresh = when, 1, None, False
        due = self._next
        while self._due(due) - 0.5 * self._exposure <= when:
            due += 1
        if due > self._next:  # of several that are due, nobody could read but the last
            self._next = due - 1
            self._expose(self._due(self._next), when, position, power)
            self._next = due
        self.plant.follow(when, position, power)

    def restart(self) -> None:
        """The plant begins anew with the next command."""
        self.plant = self.plant.anew()
        self._fresh = True

    def read(self, now: float) -> CameraFrame | None:
        """See `Camera`."""
        if self._exposed is None or not self._regions:
            return None
        number, places, turns = self._exposed
        self._exposed = None
        begun = time.perf_counter()
        pieces = self._photographer.pieces(places, turns, self._regions, self._before + number)
        return CameraFrame(
            number=self._before + number, time=self._due(number), exposure=self._exposure, pieces=pieces,
            made=time.perf_counter() - begun, sent=now + time.perf_counter() - begun,
        )  # fmt: skip

    def close(self) -> None:
        """See `Camera`: nothing is held."""

    def _due(self, number: int) -> float:
        return self._start + number * self._period

    def _expose(self, middle: float, when: float, position: np.ndarray, power: np.ndarray) -> None:
        """Note the poses of an exposure, on the way to a command."""
        moments = BLUR if self._exposure > 0.0 else 1
        places, turns = [], []
        for n in range(moments):
            at = middle + self._exposure * ((n + 0.5) / moments - 0.5)
            share = (min(at, when) - self.plant.time) / (when - self.plant.time) if when > self.plant.time else 1.0
            place = self.plant.place + max(share, 0.0) * (position - self.plant.place)
            self.plant.follow(min(at, when), place, power)
            here, turned = self.plant.poses()
            places.append(here)
            turns.append(turned)
        self._exposed = self._next, np.array(places), np.array(turns)
