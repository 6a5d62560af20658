"""Friction of rigid clusters and chains of touching spheres at the default accuracy of a body's mobility.

For a touching pair the friction is known in closed form or as published numbers. For chains and a tetrahedron the law
is the exact Stokes solution by Lamb's multipoles with collocation (`tests/reference/stokes_multipoles.py`), an
independent method that is itself held against the pair here. The frictions are those that the simulation steps with.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.special import zeta

from otwarp.hydrodynamics import body_mobility
from otwarp.scene import Body
from tests.reference.stokes_multipoles import cluster_resistance

ACCURACY = Body.mobility_accuracy

COLLOCATION = 2e-4
"""Relative error of the multipoles of degree 5 for touching spheres."""

PRINTED = 3e-4
"""Half a unit of the last printed digit of 0.645 and 0.724, over six."""

TETRAHEDRON = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(2.0)


def chain(n: int) -> np.ndarray:
    return np.c_[np.zeros((n, 2)), 2.0 * np.arange(n) - (n - 1.0)]


CLUSTERS = {
    "chain of 2": chain(2),
    "chain of 3": chain(3),
    "chain of 4": chain(4),
    "chain of 6": chain(6),
    "triangle": np.array(
        [
            [2.0 / np.sqrt(3.0) * np.cos(a), 2.0 / np.sqrt(3.0) * np.sin(a), 0.0]
            for a in (0.0, 2.0 * np.pi / 3.0, 4.0 * np.pi / 3.0)
        ]
    ),
    "tetrahedron": TETRAHEDRON,
}


def frictions(resistance: np.ndarray, spheres: int) -> tuple[np.ndarray, np.ndarray]:
    """Translation over n·6πηa and rotation over n·8πηa³, about x, y and z."""
    own = np.diag(resistance)
    return own[:3] / (6.0 * np.pi * spheres), own[3:] / (8.0 * np.pi * spheres)


@pytest.mark.parametrize("what", ["blobs", "multipoles"])
def test_touching_pair(expect_law, what):
    """Drag along and across the axis, per sphere, and torque about it, of the two methods.

    Source: Stimson & Jeffery 1926, doi:10.1098/rspa.1926.0053; Goldman, Cox & Brenner 1966,
    doi:10.1016/0009-2509(66)85036-4; Jeffery 1915, doi:10.1112/plms/s2_14.1.327: 3ζ(3)/4 about the axis.
    """
    if what == "blobs":
        resistance, bias = body_mobility(chain(2), np.ones(2), accuracy=ACCURACY, cache=False).resistance, ACCURACY
    else:
        resistance, bias = cluster_resistance(chain(2), np.ones(2), 6), COLLOCATION
    moving, turning = frictions(resistance, 2)
    expect_law(f"{what}: drag along the axis over 12πηa", moving[2], 0.645, PRINTED, bias=bias * 0.645)
    expect_law(f"{what}: drag across the axis over 12πηa", moving[:2], 0.724, PRINTED, bias=bias * 0.724)
    exact = 0.75 * float(zeta(3))
    expect_law(f"{what}: torque about the axis over 16πηa³", turning[2], exact, 1e-5 * exact, bias=bias * exact)


@pytest.mark.parametrize("name", CLUSTERS)
def test_clusters_of_touching_spheres(expect_law, name):
    """All frictions of a cluster at the default accuracy, against the exact solution.

    Source: Lamb's general solution, collocated on all surfaces: Ganatos, Pfeffer & Weinbaum 1978, J. Fluid Mech. 84,
    79.
    """
    centres = CLUSTERS[name]
    n = len(centres)
    gaps = [np.linalg.norm(a - b) for a, b in itertools.combinations(centres, 2)]
    assert min(gaps) == pytest.approx(2.0)
    exact = frictions(cluster_resistance(centres, np.ones(n), 5), n)
    found = frictions(body_mobility(centres, np.ones(n), accuracy=ACCURACY, cache=False).resistance, n)
    for what, ours, theirs in zip(("drag over 6πηa·n", "torque over 8πηa³·n"), found, exact, strict=True):
        expect_law(f"{name}: {what}", ours, theirs, COLLOCATION * theirs, bias=ACCURACY * theirs)
