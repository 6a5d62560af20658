"""How strong forces are that state it themselves: by the model's own terms, and by all that a body has."""

import dataclasses

import pytest

from otwarp.kernels.forces.force import BodyFacts, ForceRow, Load
from otwarp.kernels.forces.table import FORCES
from otwarp.scene import Flow, Scene, Settings
from otwarp.simulation.model import Model
from otwarp.simulation.resolved import resting_loads
from tests.simulation.forces import colliding
from tests.simulation.setups import harmonic

STRONG = 1e4
"""Of the force [pN]: far more than anything else that limits the step."""


def row(active, load) -> ForceRow:
    """A force that only says how strong it is."""
    return ForceRow(name="more", active=active, why=lambda f: "", why_not="", load=load)


SCENE = Scene(
    bodies=colliding(2),
    traps=(harmonic("T"),),
    flow=Flow(prim="/World/Flow", kind="shear", shear_rate=1.0),
    settings=Settings(gravity=False),
)


@pytest.mark.parametrize(
    "active", [lambda f: f.flow == "shear", lambda f: bool(f.trap_models), lambda f: f.brownian and f.pairs]
)
def test_a_row_counts_by_any_feature_of_the_model(active, monkeypatch):
    free = Model.build(SCENE, device="cpu")
    monkeypatch.setitem(FORCES, "more", row(active, lambda facts: Load(force=STRONG)))
    model = Model.build(SCENE, device="cpu")
    assert [load.force for load in model.loads] == [STRONG] * 2
    assert model.time_step < 0.1 * free.time_step
    assert [load.force for load in resting_loads(SCENE)] == [STRONG] * 2
    still = dataclasses.replace(SCENE, flow=None, traps=(), settings=Settings(gravity=False, brownian=False))
    assert not any(load.force for load in Model.build(still, device="cpu").loads)


def test_a_load_may_follow_from_the_body_and_its_parameters(monkeypatch):
    """The drag of a stirred liquid on each body, in the world where it is strongest."""

    def stirred(facts: BodyFacts) -> Load:
        return Load(force=float(facts.values["medium_viscosity"].max()) * facts.body.spheres[0].radius)

    def pushed(facts: BodyFacts) -> Load:
        return stirred(facts) + Load(force=float(facts.values["external_force"][..., 0].max()))

    monkeypatch.setitem(FORCES, "more", row(lambda f: True, pushed))
    given = {"medium_viscosity": [1e-3, 3e-3], "external_force": [[[5.0, 0.0, 0.0], [6.0, 0.0, 0.0]]] * 2}
    model = Model.build(SCENE, worlds=2, device="cpu", parameters=given)
    radii = [body.spheres[0].radius for body in SCENE.bodies]
    # the scene's own external force counts beside
    assert [load.force for load in model.loads] == pytest.approx(
        [3e-3 * r + 2.0 * f for r, f in zip(radii, (5.0, 6.0), strict=True)]
    )
