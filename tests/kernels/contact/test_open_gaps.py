"""Openings of listed contacts by the moves of a stage, against float64."""

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.contact_list import ContactList, put_term
from otwarp.kernels.contact.open_gaps import first_opening_term, open_gaps_term
from otwarp.kernels.contact.travel import opening_of
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import Move, ReadoutData, vec6
from otwarp.simulation.packing.arrays import device_array
from tests.kernels.contact.test_contact_list import empty_list

PARTNERS = np.array([[1, 0], [1, 0], [1, 0], [1, -1], [1, -1], [2, -1], [2, 0], [2, 1], [2, 1]])
"""Neighbours with the same bodies, obstacles, and contacts that stand alone."""

COUNT, BODIES = len(PARTNERS), 3
FEATURES = Features(
    driver="world", bodies=BODIES, rigid=True, obstacles=("box",), moving_obstacles=True, pairs=True, body_space=True,
    max_contacts=COUNT,
)  # fmt: skip
_put, _open, _first = put_term(FEATURES), open_gaps_term(FEATURES), first_opening_term(FEATURES)

ROUNDING = 2e-6
"""float32 openings of order 1 µm."""


@wp.kernel(enable_backward=False)
def probe(
    given: wp.array(dtype=Contact), depth: wp.array(dtype=float), again: bool, linear: wp.array(dtype=wp.vec3),
    angular: wp.array(dtype=wp.vec3), free: wp.array(dtype=vec6), drift: wp.array(dtype=vec6), listed: ContactList,
):  # fmt: skip
    count = 0
    for i in range(COUNT):
        c = given[i]
        other = wp.max(c.b, 0)
        along = opening_of(c, Move(linear[c.a], angular[c.a]), Move(linear[other], angular[other]))
        count = _put(ReadoutData(), 0, listed, count, c, _first(c, along, free, drift), wp.int64(0))
        listed.depth[i] = depth[i]
    if again:
        _open(listed, count, linear, angular, free, drift)


def lift(c: np.void, moves: np.ndarray) -> float:
    """What moves (bodies, 6) open a gap by beyond what they do along the normal: its curvature, and turns."""
    way, bow = -c["drift"].astype(float), 0.0
    for body, arm, sign in ((c["a"], c["arm_a"], 1.0), (c["b"], c["arm_b"], -1.0)):
        if body >= 0:
            turn = moves[body, 3:]
            way = way + sign * (moves[body, :3] + np.cross(turn, arm))
            bow += sign * 0.5 * np.cross(turn, np.cross(turn, arm)) @ c["normal"]
    across = way - (way @ c["normal"]) * c["normal"] - (way @ c["ridge"]) * c["ridge"]
    return (1.0 - np.sqrt(1.0 - c["curvature"] ** 2 * across @ across)) / c["curvature"] + bow


def opening(c: np.void, moves: np.ndarray) -> float:
    """What moves (bodies, 6) and the obstacle's open a gap by, along its normal."""
    found = -c["drift"].astype(float) @ c["normal"]
    for body, arm, sign in ((c["a"], c["arm_a"], 1.0), (c["b"], c["arm_b"], -1.0)):
        if body >= 0:
            found += sign * (moves[body, :3] + np.cross(moves[body, 3:], arm)) @ c["normal"]
    return found


@pytest.mark.parametrize("again", [False, True], ids=["first stage", "second stage"])
def test_gaps_open_along_normals_and_by_what_is_lifted(again, device):
    """Contacts that noise wanders over are lifted in both stages, and those that push in the second as well."""
    rng = np.random.default_rng(3)
    given = np.zeros(COUNT, dtype=Contact.numpy_dtype())
    given["a"], given["b"] = PARTNERS.T
    normal, ridge = rng.normal(size=(2, COUNT, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    ridge = np.cross(normal, ridge)
    ridge /= np.linalg.norm(ridge, axis=1, keepdims=True)
    # without rods, obstacles alone have ridges
    ridged = (rng.random(COUNT) < 0.5) & (PARTNERS[:, 1] < 0)
    given["normal"], given["ridge"] = normal, ridge * ridged[:, None]
    given["arm_a"], given["arm_b"] = rng.normal(size=(2, COUNT, 3))
    given["drift"] = 0.1 * rng.normal(size=(COUNT, 3)) * (PARTNERS[:, 1] < 0)[:, None]
    given["curvature"], given["hardness"] = rng.uniform(0.1, 0.5, COUNT), 100.0
    wanders, pushes = (np.arange(COUNT) // k % 2 == 0 for k in (1, 2))
    given["wander"] = np.where(wanders, 1e-3, 0.0)
    moves, free, drift = 0.2 * rng.normal(size=(3, BODIES, 6)).astype(np.float32)
    arrays = (given, Contact), (np.where(pushes, 0.01, 0.0), wp.float32)
    contacts, depth = (wp.array(v, dtype=t, device=device) for v, t in arrays)
    rows = (moves[:, :3], wp.vec3), (moves[:, 3:], wp.vec3), (free, vec6), (drift, vec6)
    listed = empty_list(COUNT, device)
    inputs = [contacts, depth, again, *(device_array(v, t, device) for v, t in rows), listed]
    wp.launch(probe, dim=1, inputs=inputs, device=device)
    lifted = wanders | pushes if again else wanders
    apart = (free - drift).astype(float)
    expected = [opening(c, moves.astype(float)) + up * lift(c, apart) for c, up in zip(given, lifted, strict=True)]
    np.testing.assert_allclose(listed.face.numpy()[:, 3], expected, atol=ROUNDING)
    np.testing.assert_array_equal(listed.face.numpy()[:, :3], given["normal"])
