"""Rows of the step: the built-in forces it has, then the user's."""

from otwarp.kernels.core.features import Features
from otwarp.kernels.forces.table import active_forces
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from tests.kernels.forces.setups import scene, turning


def test_rows_come_in_the_order_of_the_table():
    options = StepOptions(forces=(turning(strength={"/World/Robot": 0.7}),))
    f = Model.build(scene(traps=1), device="cpu", options=options).features
    assert [row.name for row in active_forces(f)] == ["traps", "gravity", "external force", "turning"]
    assert all(row.why(f) for row in active_forces(f))
    assert not active_forces(Features(bodies=1))
