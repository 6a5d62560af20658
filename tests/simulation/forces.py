"""Forces that users might write, and small scenes of every driver, for the tests that share them."""

from __future__ import annotations

import dataclasses

import warp as wp

import otwarp as ot
from otwarp.scene import Body, Scene, Settings
from tests.simulation.setups import robot, sphere_body

ROUNDING = {"float32": 3e-6, "float64": 1e-12}
"""Relative error of a displacement after some steps of rounding."""

SLOPE = 1.7
"""Stiffness of the linear force [pN/µm]."""


@ot.force(push="pN")
def constant(body: ot.ForceInput, push: wp.vec3):
    return push


@ot.force(stiffness="pN/µm", centre="µm")
def spring(body: ot.ForceInput, stiffness: float, centre: wp.vec3 = (0.0, 0.0, 0.0)):
    return -stiffness * (body.position - centre)


@ot.force(acts_on="spheres", stiffness="pN/µm", centre="µm")
def tether(body: ot.ForceInput, stiffness: float, centre: wp.vec3):
    return -stiffness * (body.position - centre)


@ot.force(acts_on="spheres", per_radius="pN/µm")
def by_size(body: ot.ForceInput, per_radius: float):
    return wp.vec3(0.0, 0.0, per_radius * body.radius)


@ot.force(strength="pN·µm")
def turning(body: ot.ForceInput, strength: float) -> ot.Wrench:
    return ot.Wrench(wp.vec3(0.0), wp.vec3(0.0, 0.0, strength))


AMPLITUDE = 0.7


@wp.func
def wave(time: float, frequency: float) -> float:
    return AMPLITUDE * wp.sin(6.283185307179586 * frequency * time)


@ot.force(frequency="Hz", acts_on="body")
def shaken(body: ot.ForceInput, frequency: float):
    """Calls another function, which uses a constant."""
    return wp.vec3(wave(body.time, frequency), 0.0, 0.0)


def quiet(*bodies: Body, **settings) -> Scene:
    return Scene(bodies=bodies, settings=Settings(brownian=False, time_step=1e-4, **settings))


def colliding(n: int) -> tuple[Body, ...]:
    """Beads that could touch, far apart."""
    return tuple(sphere_body(f"B{i}", (6.0 * i, 0.0, 0.0), collides=True) for i in range(n))


DRIVERS = {
    "solo": quiet(sphere_body("B0")),
    "world": quiet(*colliding(2)),
    "coupled": dataclasses.replace(
        quiet(sphere_body("B0"), sphere_body("B1", (4000.0, 0.0, 0.0))),
        settings=Settings(brownian=False, time_step=1e-4, coupling=True),
    ),
    "grid": quiet(*colliding(30)),
    "rigid": quiet(robot("B0")),
}
