"""A link gives back the contact of a lone sphere."""

import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import Move
from otwarp.kernels.drivers.grid.data import GridData, Link
from otwarp.kernels.drivers.grid.store import contact_store_terms, write_contact, write_link

_write, _read, _write_load, _write_lift = contact_store_terms(Features(driver="grid", pairs=True))


@wp.kernel(enable_backward=False)
def write_and_read(grid: GridData, out: wp.array(dtype=float)):
    c = Contact()
    c.a = 4
    c.b = 7
    c.normal = wp.vec3(0.0, 0.6, 0.8)
    c.radius = 1.0
    c.overlap = 2.0
    c.hardness = 3.0
    c.force = 4.0
    c.floor = 5.0
    c.stiffness = 6.0
    c.curvature = 7.0
    c.drift = wp.vec3(0.0, 1.0, 2.0)
    c.ridge = wp.vec3(1.0, 0.0, 0.0)
    c.give = 8.0
    c.wander = 9.0
    c.layer = 10.0
    c.response_a = Move(0.25 * c.normal, wp.vec3(0.0))
    _write(grid, 1, 2, c)
    _write_load(grid, 1, 2, 11.0)
    _write_lift(grid, 1, 2, 12.0)
    d = _read(grid, 1, 2, 4)
    out[0] = d.radius
    out[1] = d.overlap
    out[2] = d.hardness
    out[3] = d.force
    out[4] = d.floor
    out[5] = d.stiffness
    out[6] = d.curvature
    out[7] = d.give
    out[8] = d.wander
    out[9] = d.layer
    out[10] = d.load
    out[11] = d.lift
    out[12] = float(d.a)
    out[13] = float(d.b)
    out[14] = wp.length(d.normal - c.normal)
    out[15] = wp.length(d.response_a.linear - c.response_a.linear)
    out[16] = wp.length(d.drift - c.drift) + wp.length(d.ridge - c.ridge)


def test_a_link_gives_back_the_contact_of_a_lone_sphere(device):
    """All but arms, which a lone sphere has not, and its response along the normal."""
    assert _write is write_link
    assert contact_store_terms(Features(driver="grid", pairs=True, rigid=True))[0] is write_contact
    grid = GridData()
    grid.link = wp.zeros((2, 3), dtype=Link, device=device)
    out = wp.zeros(17, dtype=float, device=device)
    wp.launch(write_and_read, dim=1, inputs=[grid, out], device=device)
    got = out.numpy()
    assert got[:14].tolist() == [*range(1, 13), 4.0, 7.0]
    assert got[14] == 0.0 and got[15] < 1e-7 and got[16] == 0.0
