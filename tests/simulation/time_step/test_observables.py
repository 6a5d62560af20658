"""What a step makes wrong is listed, warned of, and refused above 10 %."""

from __future__ import annotations

import dataclasses
import warnings

import pytest

from otwarp.errors import InputError
from otwarp.scene import Settings
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from otwarp.simulation.simulation import Simulation
from otwarp.simulation.time_step.observables import OBSERVABLES, missed, spelled
from tests.simulation.setups import STIFFNESS, bead_scene, drag

RELAXATION = drag(1.0) / STIFFNESS


def scales(z: float, **options):
    how = StepOptions(time_step=z * RELAXATION, **options)
    return Model.build(bead_scene(), device="cpu", options=how).scales


@pytest.mark.parametrize(("z", "variance"), [(1.0, -1.0 / 3.0), (1.9, -0.95), (1.999, -0.9996)])
def test_an_explicit_step_that_errs_by_more_than_a_tenth_is_refused(z, variance):
    """Heun's variances are wrong by −33, −95 and −99.96 % there; who insists gets them, and the list says so."""
    with pytest.raises(InputError) as refused:
        scales(z)
    text = str(refused.value)
    assert "\n" not in text
    assert f"stationary variances in traps −{-100.0 * variance:.2g} %" in text
    assert "--allow-large-step" in text
    # what the message allows is allowed
    good = float(text.split("allowed: up to ")[1].split(" s")[0])
    with pytest.warns(UserWarning, match="misses the wanted accuracy of 1 %"):
        scales(0.999 * good / RELAXATION)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert scales(z, allow_large_step=True).errors["variance"] == pytest.approx(variance, abs=0.005)


def test_between_accuracy_and_a_tenth_a_step_is_warned_of():
    """k·dt/γ = 0.3: −2.6 % of the variance, −4.2 % of the displacement; at 0.1 all is well."""
    with pytest.warns(UserWarning, match=r"variances in traps −2\.6 %.*displacements in traps over one step −4\.2 %"):
        found = scales(0.3)
    assert list(found.missed) == ["variance", "correlation", "displacement"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not scales(0.1).missed
        # that of the scene, who wants no more
        coarse = dataclasses.replace(bead_scene(), settings=Settings(accuracy=0.05, time_step=0.3 * RELAXATION))
        Model.build(coarse, device="cpu")


def test_what_no_step_mends_is_told_and_never_refused():
    """Two steps of Leimkuhler and Matthews share noise: one-step displacements are half of what they should be."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = Simulation(bead_scene(), device="cpu", integrator="leimkuhlerMatthews").model
        Model.build(bead_scene(), device="cpu", options=StepOptions(time_step=1e-6, integrator="leimkuhlerMatthews"))
    assert model.scales.missed == {"displacement": pytest.approx(-0.5, abs=0.01)}
    assert model.scales.errors["variance"] == 0.0


def test_errors_are_spelled_by_known_names():
    assert spelled({"variance": -0.0042, "escape": 0.007}) == (
        "stationary variances in traps −0.42 %, escape times and survival in traps +0.7 %"
    )
    small = {"variance": -0.0042, "displacement": 1e-9, "escape": None}
    assert spelled(small, 1e-4) == (
        "stationary variances in traps −0.42 %, escape times and survival in traps unstable, the others below 0.01 %"
    )
    assert spelled({"wall": 0.0}, 1e-4) == "all below 0.01 %"
    assert missed({"variance": -0.02, "wall": 0.01}, 0.01) == {"variance": -0.02}
    assert list(scales(0.1).errors) == [name for name in OBSERVABLES if name in scales(0.1).errors]
