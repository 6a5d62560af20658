"""The mobilities that a scene's bodies get: as accurate as they ask for, with the rods that drag, shared when equal."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.hydrodynamics import body_mobility
from otwarp.scene import Body, Rod, Scene, Sphere
from otwarp.simulation.packing.bodies import mobilities

SPHERES = tuple(Sphere(prim=f"/World/r/s{k}", offset=(0, 0, 2.0 * k), radius=1.0) for k in (0, 1))
ROD = Rod(prim="/World/r/rod", start=(0, 0, 0), end=(0, 0, 6), radius=0.5)
ROBOT = Body(prim="/World/r", spheres=SPHERES)
CENTRES, RADII = np.array([s.offset for s in SPHERES]), np.ones(2)


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("OTWARP_CACHE", str(tmp_path))


def of(*bodies: Body):
    return mobilities(Scene(bodies=bodies))


def test_default_is_one_percent_and_zero_is_the_pair_mobilities():
    refined, plain = of(ROBOT, replace(ROBOT, prim="/World/q", mobility_accuracy=0.0))
    assert 0 < refined.error <= 0.01
    np.testing.assert_array_equal(plain.mobility, body_mobility(CENTRES, RADII).mobility)
    assert refined.resistance[2, 2] == pytest.approx(12 * np.pi * 0.64514, rel=0.002)  # Stimson & Jeffery 1926


def test_finer_when_asked_for():
    coarse, fine = of(ROBOT, replace(ROBOT, prim="/World/q", mobility_accuracy=1e-3))
    assert fine.blobs > coarse.blobs
    assert fine.error <= 1e-3


def test_rods_that_drag_count():
    bare, dragging, looks = of(
        ROBOT,
        replace(ROBOT, prim="/World/a", rods=(ROD,)),
        replace(ROBOT, prim="/World/b", rods=(replace(ROD, drag=False),)),
    )
    assert looks is bare
    assert dragging.resistance[0, 0] > 1.2 * bare.resistance[0, 0]
    assert len(dragging.flow_coupling) == 2


def test_a_lone_sphere_is_exact_and_shared():
    beads = [Body(prim=f"/World/b{k}", spheres=(Sphere(prim=f"/World/b{k}/s", radius=1.5),)) for k in range(50)]
    found = of(*beads)
    assert len({id(m) for m in found}) == 1
    np.testing.assert_array_equal(np.diag(found[0].mobility)[:3], 1 / (6 * np.pi * 1.5))


def test_given_mobility_goes_before_everything():
    given = tuple(np.diag([0.02, 0.02, 0.03, 0.001, 0.001, 0.004]).ravel())
    (move,) = of(replace(ROBOT, mobility=given, rods=(ROD,)))
    np.testing.assert_allclose(move.mobility.ravel(), given)


def test_what_cannot_be_reached_names_the_body(monkeypatch):
    monkeypatch.setattr("otwarp.hydrodynamics.blobs.MOST_BLOBS", 100)
    with pytest.raises(InputError, match=r"^/World/r: ot:body:mobilityAccuracy = 0.0001: needs 192 surface blobs"):
        of(replace(ROBOT, mobility_accuracy=1e-4))
