"""An entry gives back the contact that was stored."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import Move
from otwarp.kernels.drivers.grid.data import EntryData, whole_contacts
from otwarp.kernels.drivers.grid.entries import parts, read_entry_term, write_entry_term

SCALARS = ("radius", "overlap", "hardness", "floor", "stiffness", "curvature", "lift", "give", "wander", "layer")


def copy_kernel(f: Features) -> wp.Kernel:
    """Kernel that stores contacts as entries and reads them again."""
    write_entry, read_entry = write_entry_term(f), read_entry_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def copy(entry: EntryData, given: wp.array(dtype=Contact), found: wp.array(dtype=Contact)):
        """Entry n from contact n, and back."""
        n = wp.tid()
        write_entry(entry, n, given[n])
        found[n] = read_entry(entry, n)

    return copy


def a_contact(rng: np.random.Generator, *, whole: bool) -> Contact:
    """Random numbers in every field; without arms and turns the response is along the normal."""
    c = Contact()
    c.a, c.b = 3, 7
    normal = rng.normal(size=3)
    c.normal = wp.vec3(*(normal / np.linalg.norm(normal)))
    for name in SCALARS:
        setattr(c, name, float(rng.uniform(0.1, 1.0)))
    c.load = c.force = float(rng.uniform(0.1, 1.0))
    c.drift, c.ridge = wp.vec3(*rng.normal(size=3)), wp.vec3(*rng.normal(size=3))
    c.response_a, c.response_b = Move(), Move()
    c.response_a.linear = wp.vec3(*rng.normal(size=3)) if whole else 0.3 * c.normal
    c.response_b.linear = wp.vec3(*rng.normal(size=3)) if whole else (0.3 - c.give) * c.normal
    if whole:
        c.arm_a, c.arm_b = wp.vec3(*rng.normal(size=3)), wp.vec3(*rng.normal(size=3))
        c.response_a.angular, c.response_b.angular = wp.vec3(*rng.normal(size=3)), wp.vec3(*rng.normal(size=3))
    return c


@pytest.mark.parametrize("rigid", [False, True])
def test_what_is_stored_is_read(rigid, device):
    f = Features(driver="grid", bodies=30, rigid=rigid, pairs=True, by_world=True)
    assert whole_contacts(f) == rigid
    rng = np.random.default_rng(1)
    given = wp.array([a_contact(rng, whole=rigid) for _ in range(8)], dtype=Contact, device=device)
    found = wp.zeros(8, dtype=Contact, device=device)
    entry = EntryData()
    entry.body = wp.zeros(8, dtype=wp.vec2i, device=device)
    entry.part = wp.zeros((parts(f), 8), dtype=wp.vec4, device=device)
    entry.load = wp.zeros(8, dtype=wp.float32, device=device)
    entry.ahead = wp.zeros((2, 8), dtype=wp.float32, device=device)
    wp.launch(copy_kernel(f), dim=8, inputs=[entry, given, found], device=device)
    wanted, got = given.numpy(), found.numpy()
    fields = ("a", "b", "normal", "arm_a", "arm_b", "drift", "ridge", "load", "force", *SCALARS)
    for name in fields:
        np.testing.assert_array_equal(got[name], wanted[name], err_msg=name)
    for body in ("response_a", "response_b"):
        for part in ("linear", "angular"):
            np.testing.assert_allclose(got[body][part], wanted[body][part], atol=1e-6, err_msg=body)
