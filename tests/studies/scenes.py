"""Scenes and studies of the tests of studies."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

import otwarp as ot
from otwarp.laws import TrapLaw
from otwarp.scene import Body, SceneBuilder, Settings, Sphere, Track, Trap
from otwarp.studies.axes import grid, values
from otwarp.studies.observables import first_passage, trapped
from otwarp.studies.stopping.rules import trials
from otwarp.studies.study import Study
from tests.simulation.setups import obstacle


@ot.order(unit="k_BT")
def energy(now: ot.WorldNow, stiffness: float = 0.5) -> float:  # type: ignore[valid-type]
    """Energy of the bead in its well."""
    away = now.state.position[now.world, 0] - wp.vec3(0.0, 0.0, 10.0)
    return 0.5 * stiffness * wp.length_sq(away) / 0.0041164


def study_of_a_well(powers: int, trials: int, *, starts: str = "0, 0.1, 0.2, 0.3") -> str:
    """A study file beside the scene `well.usda`: trapped, and when not, by so many powers and starts [µm]."""
    return f"""
scene = "well.usda"
seed = 3
[[axis]]
name = "trap_power"
grid = {{ from = 0.2, to = 1, count = {powers} }}
unit = "mW"
[[axis]]
name = "start.x:/World/bead"
values = [{starts}]
unit = "µm"
[[observable]]
kind = "trapped"
until = "0.1 s"
[[observable]]
kind = "first_passage"
[stop]
trials = {trials}
"""


def bead_in_a_well(
    folder: Path,
    *,
    stiffness: float = 0.5,
    cutoff: float = 0.4,
    accuracy: float = 0.05,
    speed: float = 0.0,
    axial: float | None = None,
    brownian: bool = True,
    floor: float | None = None,
) -> Path:
    """A bead of radius 0.5 µm in a harmonic trap that ends at `cutoff` [µm] and moves at `speed` [µm/s]; the file.

    Along the beam, which is z, it may have another stiffness, `axial` [pN/µm per mW]. It moves along z, or above a
    hydrodynamic plane, `floor` [µm] below it, along x.
    """
    duration = 2.0 if speed else 0.5
    way = speed * duration
    path = [(0.0, 0.0, 10.0), (0.0, 0.0, 10.0 + way) if floor is None else (way, 0.0, 10.0)]
    track = Track(times=np.array([0.0, duration]), values=np.array(path)) if speed else Track.constant(path[0])
    builder = SceneBuilder(settings=Settings(duration=duration, accuracy=accuracy, brownian=brownian))
    if floor is not None:
        builder.add(dataclasses.replace(obstacle("Floor", "plane", (0.0, 0.0, 10.0 - floor)), hydrodynamic=True))
    builder.add(
        Body(
            prim="/World/bead",
            position=(0.0, 0.0, 10.0),
            spheres=(Sphere(prim="/World/bead/sphere", radius=0.5, refractive_index=1.59),),
        )
    )
    builder.add(
        Trap(
            prim="/World/trap",
            position=track,
            power=Track.constant(1.0),
            radial=TrapLaw(stiffness=stiffness, threshold=cutoff, cutoff=cutoff, power=1.0),
            axial=None if axial is None else TrapLaw(stiffness=axial, threshold=cutoff, cutoff=cutoff, power=1.0),
            holds="/World/bead/sphere",
        )
    )
    return builder.save(folder / "well.usda")


def pair_in_wells(folder: Path, *, speed: float = 0.0) -> Path:
    """A robot of two spheres, 2 µm apart, each in a trap as that of `bead_in_a_well`, moving along x; the file."""
    builder = SceneBuilder(settings=Settings(duration=2.0))
    spheres = [
        Sphere(prim=f"/World/pair/s{n}", offset=(x, 0.0, 0.0), radius=0.5, refractive_index=1.59)
        for n, x in enumerate((-1.0, 1.0))
    ]
    builder.add(Body(prim="/World/pair", position=(0.0, 0.0, 10.0), spheres=tuple(spheres)))
    for n, sphere in enumerate(spheres):
        way = np.add(sphere.offset, [(0.0, 0.0, 10.0), (2.0 * speed, 0.0, 10.0)])
        builder.add(
            Trap(
                prim=f"/World/trap{n}",
                position=Track(times=np.array([0.0, 2.0]), values=way) if speed else Track.constant(tuple(way[0])),
                power=Track.constant(1.0),
                radial=TrapLaw(stiffness=0.5, threshold=0.4, cutoff=0.4, power=1.0),
                holds=sphere.prim,
            )
        )
    return builder.save(folder / "pair.usda")


def study_of(scene: Path, **how: Any) -> Study:
    """A small study of the bead, but for what is given: what traps hold from two starts, by three powers."""
    asked = {
        "axes": {
            "trap_power": grid(0.2, 1.0, 3, unit="mW"),
            "start.x:/World/bead": values([0.0, 200.0], unit="nm"),
        },
        "observables": [trapped(until=0.1), first_passage()],
        "stop": trials(64),
        "seed": 3,
    }
    return Study(scene, **(asked | how))


def short_study(scene: Path) -> Study:
    """Three blocks of short trials of a bead in a well."""
    axes = {
        "trap_power": grid(0.2, 1.0, 6, unit="mW"),
        "start.x:/World/bead": values([0.0, 100.0, 200.0, 300.0], unit="nm"),
    }
    return Study(scene, axes=axes, observables=[trapped(until=0.004)], stop=trials(2_048), seed=3)
