"""`Plant`: the laboratory that a session's traps act on, with physics, noise and parameters of its own."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.perception.overlaps import MOST, Overlaps
from otwarp.scene import Body, Scene
from otwarp.simulation.simulation import Simulation

PART = 4e-3
"""Seconds of the clock after which moving traps are put farther: two parts of a turn of the loop.

Steps of a millisecond, as the twin's, cost three times as much of a machine that has to render as well; with a robot
that relaxes in 6 ms this makes 4 % of the drag."""


@dataclass(frozen=True, kw_only=True)
class PlantOptions:
    """By what the laboratory differs from the twin.

    Attributes:
        seed: Of its noise, and of its sizes.
        viscosity: Factor of the medium's viscosity.
        spread: Relative standard deviation of the bodies' sizes, each of which is drawn once.
        device: Of its simulation.

    Raises:
        InputError: A number out of range.
    """

    seed: int = 1
    viscosity: float = 1.0
    spread: float = 0.0
    device: str | None = None

    def __post_init__(self) -> None:
        for name, value, low, high in (("viscosity", self.viscosity, 0.01, 100.0), ("spread", self.spread, 0.0, 0.3)):
            if not low <= value <= high:
                raise InputError(f"plant {name} is {value:g}; allowed: {low:g} to {high:g}")
        if not 0 <= self.seed < 2**32:
            raise InputError(f"plant seed is {self.seed}; allowed: 0 to {2**32 - 1}")


def plant_of(scene: Scene, file: str | Path | None) -> Scene:
    """The scene of a laboratory that the traps of a twin may act on, seen by the twin's camera.

    Args:
        scene: Of the twin.
        file: Another scene; None: the same.

    Raises:
        InputError: It has other traps.
    """
    if file is None:
        return scene
    other = Scene.load(file)
    if len(other.traps) != len(scene.traps):
        raise InputError(
            f"--plant {file} has {len(other.traps)} traps; allowed: as many as the twin, {len(scene.traps)}"
        )
    return dataclasses.replace(other, camera=scene.camera)


def plant_scene(scene: Scene, options: PlantOptions) -> Scene:
    """The scene as the laboratory has it: another viscosity, bodies that are larger or smaller than they should be.

    Args:
        scene: As authored.
        options: By what it differs.
    """
    medium = dataclasses.replace(scene.medium, viscosity=scene.medium.viscosity * options.viscosity)
    bodies = scene.bodies
    if options.spread:
        factors = np.exp(options.spread * np.random.default_rng([options.seed, 17]).standard_normal(len(bodies)))
        bodies = tuple(_scaled(body, float(f)) for body, f in zip(bodies, factors, strict=True))
    made = dataclasses.replace(scene, medium=medium, bodies=bodies)
    return _apart(made) if options.spread else made


def _scaled(body: Body, factor: float) -> Body:
    """A body of another size and the same shape; a mobility that was given for the old size is left to be computed."""

    def times(v: tuple[float, float, float]) -> tuple[float, float, float]:
        return v[0] * factor, v[1] * factor, v[2] * factor

    spheres = tuple(dataclasses.replace(s, offset=times(s.offset), radius=s.radius * factor) for s in body.spheres)
    rods = tuple(
        dataclasses.replace(r, start=times(r.start), end=times(r.end), radius=r.radius * factor) for r in body.rods
    )
    return dataclasses.replace(body, spheres=spheres, rods=rods, mobility=None)


def _apart(scene: Scene) -> Scene:
    """The scene, its bodies out of each other where they have grown into each other: cells stay, robots give way."""
    bodies = scene.bodies
    if len(bodies) > MOST:
        return scene
    order = sorted(range(len(bodies)), key=lambda n: bodies[n].kind != "cell")
    position, turn = np.array([b.position for b in bodies]), np.array([b.orientation for b in bodies])
    before = position.copy()
    Overlaps(scene, np.zeros_like(position), order).part(position, turn, ())
    placed = tuple(
        dataclasses.replace(body, position=(float(here[0]), float(here[1]), float(here[2])))
        if np.any(here != there)
        else body
        for body, here, there in zip(bodies, position, before, strict=True)
    )
    return dataclasses.replace(scene, bodies=placed)


class Plant:
    """A simulation that is moved by commands of traps alone, in time with the session's clock.

    Between two commands its traps go in a straight line, as those of the twin do; after the last they stay.

    Args:
        scene: As the laboratory has it, see `plant_scene`.
        start: Time of the session's clock at which it begins [s].
        seed, device: As `Simulation`.

    Attributes:
        sim: The simulation.
        place: (T, 3) where its traps are [µm].
    """

    def __init__(self, scene: Scene, *, start: float = 0.0, seed: int = 1, device: str | None = None):
        self.sim = Simulation(scene, seed=seed, device=device, threads=1)
        self._start = start
        self._again: dict[str, Any] = {"seed": seed, "device": device}
        traps = scene.traps
        self.place = np.array([t.position.at(0.0) for t in traps], dtype=float).reshape(-1, 3)
        self._power = np.array([t.power.at(0.0)[0] for t in traps], dtype=float)
        self._write(self.place, self._power)

    def anew(self) -> Plant:
        """Another one, at the start of the scene, with the same noise."""
        return Plant(self.sim.scene, **self._again)

    def begin(self, start: float) -> None:
        """Say at what time of the session's clock its own begins [s]; before its first step."""
        self._start = start

    @property
    def time(self) -> float:
        """How far it is, on the session's clock [s]."""
        return self._start + self.sim.time

    def advance(self, to: float) -> None:
        """Go on to a time of the session's clock [s], in whole steps, with the traps where they are."""
        steps = round((to - self.time) / self.sim.time_step)
        if steps > 0:
            self.sim.step(steps)

    def follow(self, time: float, position: np.ndarray, power: np.ndarray) -> None:
        """Go on to the time of a command while the traps go where it wants them.

        Args:
            time: Of the command, on the session's clock [s]; one that is past moves the traps at once.
            position: (T, 3) [µm].
            power: (T) [mW].
        """
        first, way = self.place, position - self.place
        start, span = self.time, time - self.time
        if not np.any(way):
            self.advance(time)
        else:
            parts = max(1, round(span / PART)) if span > 0.0 else 0
            for n in range(parts):
                self._write(first + way * ((n + 0.5) / parts), self._power)
                self.advance(start + span * (n + 1) / parts)
        self.place, self._power = position.copy(), power.copy()
        self._write(self.place, self._power)

    def poses(self) -> tuple[np.ndarray, np.ndarray]:
        """(B, 3) [µm] and (B, 4) of the bodies' prims now."""
        position, orientation = self.sim.prim_poses()
        return np.array(position[0]), np.array(orientation[0])

    def _write(self, position: np.ndarray, power: np.ndarray) -> None:
        if len(position):
            self.sim.control.set(trap_position=position, trap_power=power, follow=np.zeros(len(power), dtype=int))
