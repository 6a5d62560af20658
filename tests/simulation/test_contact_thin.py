"""Nothing passes through: thin walls of every shape, sheets and small obstacles against traps at their speed limit."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.kernels.contact.obstacles import SHAPES
from otwarp.kernels.core.features import MAX_WORLD_BODIES
from otwarp.laws import TrapLaw
from otwarp.scene import Body, Material, Medium, Obstacle, Rod, Scene, Settings, Sphere, Track, Trap
from otwarp.simulation.simulation import Simulation
from otwarp.simulation.time_step.timescales import TRAVEL_FRACTION
from tests.reference.rotations import matrix
from tests.reference.segments import segment_segment
from tests.simulation.setups import POWER, STIFFNESS, VISCOSITY, drag, neutral

SPEED = 150.0
"""Speed limit of the traps [µm/s]."""

WALL, BEYOND = 3.0, 9.0
"""Where the obstacle stands, and where the traps are sent [µm]; they then pull with 6 pN and more."""

THIN = 0.01
"""Half thickness of the walls [µm]: a body moves 0.3 µm per step before it meets them."""

PULL = 1.0
"""Stiffness of a trap [pN/µm]."""

SEEN = 2e-3
"""Overlap by rounding and by the law's tolerance on top of Hertz's, relative to the radius."""

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * [THIN, 7.0, 7.0]
FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)  # fmt: skip
SQUARE = np.array([[0.0, y, z] for y in (-7, 7) for z in (-7, 7)])
SHEET = np.array([[0, 1, 3], [0, 3, 2]])
HALF = float(np.sqrt(0.5))
TOWARDS = (0.0, -HALF, 0.0, HALF)
"""Rotation that takes +Z to −X."""


def wall(kind: str) -> Obstacle:
    """An obstacle at x = WALL, in the way of what comes along +X."""
    more, turn, shape = {}, (0.0, 0.0, 0.0, 1.0), kind.split("-")[0]
    if kind == "plane":
        turn = TOWARDS
    elif kind == "box":
        more = {"size": (THIN, 7.0, 7.0)}
    elif kind == "cylinder":
        turn, more = TOWARDS, {"size": (7.0, THIN, 0.0)}
    elif kind in ("sphere", "capsule"):
        more = {"size": (0.3, 7.0 if kind == "capsule" else 0.0, 0.0)}
    elif kind == "mesh":
        more = {"vertices": CORNERS, "triangles": FACES}
    elif kind == "mesh-sheet":
        more = {"vertices": SQUARE, "triangles": SHEET}
    elif kind == "mesh-behind":
        more = {"vertices": SQUARE, "triangles": SHEET[:, ::-1]}
    place = Track.constant((WALL, 0.0, 0.0))
    return Obstacle(prim="/World/Wall", shape=shape, position=place, orientation=Track.constant(turn), **more)


THICK = {"plane": 0.0, "box": THIN, "cylinder": THIN, "sphere": 0.3, "capsule": 0.3, "mesh": THIN,
         "mesh-sheet": 0.0, "mesh-behind": 0.0}  # fmt: skip
"""Half thickness of each along x [µm]."""

RELATIVE = {"sphere": 0.3 / 1.3, "capsule": (0.3 / 1.3) ** 0.5}
"""Radius of Hertz's law for a bead of 1 µm where it is not that of the bead [µm]: 1/R = √(AB), curvatures added."""

EVERYTHING = tuple(
    dataclasses.replace(wall(kind), prim=f"/World/Far{kind}", position=Track.constant((500.0, 0.0, 0.0)))
    for kind in SHAPES
)
"""One obstacle of every shape, far away, so that all tests share their kernels."""


def scene(bodies: tuple[Body, ...], traps: tuple[Trap, ...], obstacles: tuple[Obstacle, ...], **settings) -> Scene:
    return Scene(
        medium=Medium(viscosity=VISCOSITY),
        bodies=bodies,
        traps=traps,
        obstacles=(*obstacles, *EVERYTHING),
        settings=Settings(**({"accuracy": 0.1, "brownian": False} | settings)),
    )


def trap(name: str, holds: Sphere, at: tuple[float, float, float], **more) -> Trap:
    law = TrapLaw(stiffness=STIFFNESS, power=POWER)
    return Trap(
        prim=f"/World/{name}", position=Track.constant(at), power=Track.constant(PULL / STIFFNESS * POWER),
        model="harmonic", radial=law, speed_limit=SPEED, holds=holds.prim, **more,
    )  # fmt: skip


def drive(sim: Simulation, targets: np.ndarray, steps: int) -> np.ndarray:
    """(steps, B, 3) positions after every step of a run in which the traps are sent to `targets`."""
    sim.control.set(trap_position=targets)
    places = []
    for _ in range(steps):
        sim.step()
        places.append(sim.state.position.numpy()[0].astype(float))
    return np.array(places)


@pytest.fixture(params=["world", "grid"])
def driver(request, monkeypatch) -> str:
    if request.param == "grid":
        monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 0)
    return request.param


@pytest.mark.parametrize("modulus", [1e3, 1e6, 3e9])
@pytest.mark.parametrize("kind", [*SHAPES, "mesh-sheet", "mesh-behind"])
def test_a_bead_at_the_speed_limit_stops_at_every_shape(kind, modulus, driver, device):
    """At the step that the scene chooses, from before the impact until the trap is far behind the wall."""
    bead = neutral("A", (0.0, 0.0, 0.0), material=Material(youngs_modulus=modulus, poisson_ratio=0.4))
    sim = Simulation(scene((bead,), (trap("T", bead.spheres[0], (0, 0, 0)),), (wall(kind),)), device=device)
    assert sim.model.features.driver == driver
    assert sim.time_step * SPEED == pytest.approx(TRAVEL_FRACTION)
    x = drive(sim, np.array([[BEYOND, 0.0, 0.0]]), 100)[:, 0, 0]
    face = WALL - THICK[kind]
    # Hertz's overlap of the largest pull, two of which the impact does not exceed
    root = RELATIVE.get(kind, 1.0) ** 0.5
    sunk = (0.75 * PULL * (BEYOND - face + 1.0) * (1 - 0.4**2) / (modulus * root)) ** (2 / 3)
    assert x.max() < face - 1.0 + sunk + SEEN
    assert x[-1] > face - 1.0 - SEEN
    pull = PULL * (BEYOND - x[-1])
    assert sim.readout.contact_load.numpy()[0, 0] == pytest.approx(pull, rel=1e-2)


@pytest.mark.parametrize("factor", [1.0, 8.0])
def test_a_rod_at_the_speed_limit_stops_at_every_thin_wall(factor, device):
    """Side on, with a tenth of the trap force per step; also at steps eight times as long, in which the free move of
    0.8 of the rod's radius is several times the wall's thickness."""
    radius = 0.25
    ends = [Sphere(prim=f"/World/A/S{i}", offset=(0.0, y, 0.0), radius=0.5, collides=False)
            for i, y in enumerate((-4.0, 4.0))]  # fmt: skip
    rod = Rod(prim="/World/A/Rod", start=(0.0, -4.0, 0.0), end=(0.0, 4.0, 0.0), radius=radius)
    body = Body(prim="/World/A", spheres=tuple(ends), rods=(rod,))
    traps = tuple(trap(f"T{i}", s, s.offset) for i, s in enumerate(ends))
    step = Simulation(scene((body,), traps, ()), device=device).time_step
    assert step * SPEED == pytest.approx(TRAVEL_FRACTION * radius)
    for kind in ("box", "cylinder", "mesh", "mesh-sheet", "mesh-behind"):
        sim = Simulation(scene((body,), traps, (wall(kind),)), device=device, time_step=factor * step)
        steps = int(0.12 / sim.time_step)
        x = drive(sim, np.array([[BEYOND, -4.0, 0.0], [BEYOND, 4.0, 0.0]]), steps)[:, 0, 0]
        face = WALL - THICK[kind]
        assert x.max() < face - radius + SEEN
        assert x[-1] > face - radius - SEEN


def test_rods_that_cross_do_not_pass_through_each_other(device):
    """A rod of 8 µm driven with its middle at an upright capsule: it slides off over one end, always outside."""
    ends = [Sphere(prim=f"/World/A/S{i}", offset=(0.0, y, 0.0), radius=0.5, collides=False)
            for i, y in enumerate((-4.0, 4.0))]  # fmt: skip
    rod = Rod(prim="/World/A/Rod", start=(0.0, -4.0, 0.0), end=(0.0, 4.0, 0.0), radius=0.25)
    body = Body(prim="/World/A", spheres=tuple(ends), rods=(rod,))
    traps = tuple(trap(f"T{i}", s, s.offset) for i, s in enumerate(ends))
    sim = Simulation(scene((body,), traps, (wall("capsule"),)), device=device)
    sim.control.set(trap_position=np.array([[BEYOND, -4.0, 0.0], [BEYOND, 4.0, 0.0]]))
    low, high = np.array([WALL, 0.0, -7.0]), np.array([WALL, 0.0, 7.0])
    apart = []
    for _ in range(int(0.12 / sim.time_step)):
        sim.step()
        place = sim.state.position.numpy()[0, 0].astype(float)
        along = matrix(sim.state.orientation.numpy()[0, 0].astype(float)) @ np.array([0.0, 4.0, 0.0])
        apart.append(segment_segment(place - along, place + along, low, high))
    assert min(apart) == pytest.approx(0.3 + 0.25, abs=SEEN)
    assert sim.time_step * SPEED < 0.1 * (0.3 + 0.25)


def test_a_pushed_bead_stops_at_a_thin_wall(driver, device):
    """The first of two beads has no trap: the one behind it drives it against the wall with up to 20 pN.

    It may slip around the smaller one in the end, which no law forbids, but the wall then stops it too.
    """
    beads = (neutral("A", (0.0, 0.0, 0.0)), neutral("B", (2.1, 0.0, 0.0), radius=0.6, trapped=False))
    thin = dataclasses.replace(wall("box"), position=Track.constant((4.0, 0.0, 0.0)))
    pulls = trap("T0", beads[0].spheres[0], (0, 0, 0))
    # beads that meet have two traps
    off = dataclasses.replace(trap("T1", beads[0].spheres[0], (0, 0, 0)), power=Track.constant(0.0))
    sim = Simulation(scene(beads, (pulls, off), (thin,)), device=device)
    place = drive(sim, np.array([[22.0, 0.0, 0.0], [0.0, 0.0, 0.0]]), 300)
    assert np.all(place[:, :, 0].max(axis=0) < 4.0 - THIN - np.array([1.0, 0.6]) + SEEN)
    assert place[-1, 1, 0] > 4.0 - THIN - 0.6 - SEEN
    assert np.linalg.norm(place[:, 1] - place[:, 0], axis=1).min() > 1.6 - SEEN


def test_beads_do_not_pass_through_each_other(driver, device):
    """Head on, each at the speed limit: they meet in the middle and stay apart."""
    beads = (neutral("A", (-2.0, 0.0, 0.0)), neutral("B", (2.0, 0.0, 0.0)))
    traps = tuple(trap(f"T{i}", b.spheres[0], b.position) for i, b in enumerate(beads))
    sim = Simulation(scene(beads, traps, ()), device=device)
    x = drive(sim, np.array([[9.0, 0.0, 0.0], [-9.0, 0.0, 0.0]]), 150)[:, :, 0]
    assert (x[:, 1] - x[:, 0]).min() > 2.0 - SEEN
    assert (x[:, 1] - x[:, 0])[-1] < 2.0


def test_rods_among_many_bodies_are_refused(device):
    """The grid driver knows spheres alone; rods that do not collide may be there."""
    rod = Rod(prim="/World/B0/Rod", start=(0.0, 0.0, 0.0), end=(0.0, 2.0, 0.0), radius=0.5)
    beads = [neutral(f"B{i}", (4.0 * i, 0.0, 0.0)) for i in range(MAX_WORLD_BODIES + 1)]
    with pytest.raises(InputError, match=r"/World/B0/Rod: ot:rod:collides = true: must be false in a scene of 25 bod"):
        Simulation(scene((dataclasses.replace(beads[0], rods=(rod,)), *beads[1:]), (), ()), device=device)


def test_the_speed_limit_decides_the_step(device):
    """A command may ask for the limit at any time, so it counts although no trap moves in the scene."""
    bead = neutral("A", (0.0, 0.0, 0.0))
    slow = dataclasses.replace(trap("T", bead.spheres[0], (0, 0, 0)), speed_limit=0.5 * SPEED)
    fast, half = (Simulation(scene((bead,), (t,), (wall("box"),)), device=device).time_step
                  for t in (trap("T", bead.spheres[0], (0, 0, 0)), slow))  # fmt: skip
    assert half == pytest.approx(2.0 * fast)
    assert fast < 0.2 * drag(1.0) / PULL
