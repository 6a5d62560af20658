"""Lists of contacts field by field hold what whole records hold."""

from typing import Any

import numpy as np
import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.contact_list import (
    ContactList,
    face_term,
    has_ridges,
    law_of,
    load_at,
    put_term,
    unused_fields,
)
from otwarp.kernels.core.faults import Fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import ReadoutData
from otwarp.simulation.packing.arrays import device_array

ROOM = 2
FEATURES = Features(
    driver="world", bodies=3, obstacles=("box",), moving_obstacles=True, pairs=True, body_space=True, max_contacts=ROOM
)
_put, _face = put_term(FEATURES), face_term(FEATURES)


def empty_list(length: int, device: str) -> Any:
    """A list with room for so many contacts, in all its fields."""
    listed = ContactList()
    for name, field in ContactList.vars.items():
        setattr(listed, name, wp.zeros(length, dtype=field.type.dtype, device=device))
    return listed


@wp.kernel(enable_backward=False)
def keep(
    readout: ReadoutData, given: wp.array(dtype=Contact), listed: ContactList, found: wp.array(dtype=Contact)
):  # fmt: skip
    count = 0
    for i in range(wp.static(ROOM + 1)):
        count = _put(readout, 0, listed, count, given[i], 0.0, wp.int64(7))
    for i in range(ROOM):
        listed.depth[i] = 0.04
        c = _face(listed, i)
        forces = law_of(listed.law[i], listed.path[i])
        c.overlap = forces.overlap
        c.hardness = forces.hardness
        c.give = forces.give
        c.floor = forces.floor
        c.wander = forces.wander
        c.layer = forces.layer
        c.load = load_at(listed, i)
        found[i] = c


def test_fields_are_those_of_the_records(device):
    """A full list is a fault of the body whose contact has no room."""
    rng = np.random.default_rng(0)
    given = np.zeros(ROOM + 1, dtype=Contact.numpy_dtype())
    names = ("normal", "arm_a", "arm_b", "overlap", "hardness", "give", "floor", "wander", "layer", "curvature",
             "ridge", "drift")  # fmt: skip
    for name in names:
        given[name] = rng.uniform(0.1, 1.0, given[name].shape)
    given["a"], given["b"] = [1, 2, 2], [-1, 0, 1]
    # obstacles alone move by themselves, and have ridges where there are no rods
    given["ridge"][1:] = given["drift"][1:] = 0.0
    readout = ReadoutData()
    readout.fault = device_array(np.zeros((1, 3)), wp.int32, device, ndim=2)
    readout.fault_step = device_array(np.zeros((1, 3)), wp.int64, device, ndim=2)
    readout.fault_count = device_array([0], wp.int32, device)
    found = wp.zeros(ROOM, dtype=Contact, device=device)
    wp.launch(
        keep,
        dim=1,
        inputs=[readout, wp.array(given, dtype=Contact, device=device), empty_list(ROOM, device), found],
        device=device,
    )
    back = found.numpy()
    for name in (*names, "a", "b"):
        np.testing.assert_array_equal(back[name], given[name][:ROOM])
    np.testing.assert_allclose(back["load"], (given["floor"] + given["hardness"] * 0.008)[:ROOM], rtol=1e-6)
    assert readout.fault.numpy().tolist() == [[0, 0, int(Fault.OVERFLOW)]]


def test_only_fields_with_a_use_are_kept():
    plain = Features(driver="world", obstacles=("plane",), body_space=True)
    assert unused_fields(plain) == {"whole", "ridge", "drift"}
    assert unused_fields(FEATURES) == {"whole"}
    assert has_ridges(FEATURES) and not has_ridges(plain)
    assert "whole" not in unused_fields(Features(driver="world", pairs=True))
