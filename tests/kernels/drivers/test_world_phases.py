"""The world driver in phases against the one of a single kernel."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.errors import SimulationError
from otwarp.kernels.core.faults import Fault
from otwarp.kernels.core.precision import kernel_module
from otwarp.kernels.step import make_step
from otwarp.scene import Scene
from otwarp.shipped import shipped
from otwarp.simulation.drivers.stepping import FusedStepper, PhasedStepper, StepperParts
from otwarp.simulation.simulation import Simulation
from tests.simulation.test_determinism import touching_scene

WORLDS = 6

ROUNDED = 2e-5
"""Places and forces of equal steps in kernels of a GPU [µm, pN], whose compiler fuses other multiplications in each."""


FORMS = {
    "one kernel": {"phased": False, "team": 1},
    "phases": {"phased": True, "team": 1},
    "teams": {"phased": True, "team": 8},
}


def stepped_as(form: str, device: str, scene: Scene | None = None) -> Simulation:
    sim = Simulation(scene or touching_scene(), worlds=WORLDS, seed=31, device=device)
    step = make_step(dataclasses.replace(sim.model.features, cached=False, **FORMS[form]))
    parts = StepperParts(step, sim.model, sim.state, sim.control, sim.last_readout, threads=1)
    sim._stepper = PhasedStepper(parts) if step.phases else FusedStepper(parts)
    return sim


@pytest.mark.parametrize("form", ["phases", "teams"])
def test_same_steps_however_launched(form, device):
    """Graphs of one step and of sixteen give what one kernel gives for all of them, contact forces included."""
    fused, phased = stepped_as("one kernel", device), stepped_as(form, device)
    fused.step(40)
    for steps in (1, 37, 2):
        phased.step(steps)
    same = {"rtol": 0.0, "atol": 0.0 if device == "cpu" else ROUNDED}
    for name in ("position", "contact_force", "contact_load"):
        a, b = (getattr(s.state if name == "position" else s.readout, name).numpy() for s in (fused, phased))
        assert np.abs(a).max() > 0.01
        np.testing.assert_allclose(b, a, **same)


@pytest.mark.parametrize("form", ["phases", "teams"])
def test_key_frames_are_looked_up_once_for_all_worlds(form, device):
    """Two robots whose traps move squeeze a cell, before gates that move: as where each thread looks for itself."""
    scene = Scene.load(shipped("scenes", "cell_delivery"))
    fused, phased = stepped_as("one kernel", device, scene), stepped_as(form, device, scene)
    other = PhasedStepper(
        StepperParts(
            make_step(phased._stepper.features), phased.model, phased.state, phased.control, phased.last_readout
        )
    )
    assert phased._stepper.phases.look is not None
    # another stepper of the same model has room of its own
    assert phased.model.data.traps.step_value is None
    assert other._data().traps.step_value.ptr != phased._stepper._data().traps.step_value.ptr
    fused.step(75)
    for steps in (1, 37, 37):
        phased.step(steps)
    same = {"rtol": 0.0, "atol": 0.0 if device == "cpu" else ROUNDED}
    for name in ("position", "orientation"):
        a, b = (getattr(s.state, name).numpy() for s in (fused, phased))
        np.testing.assert_allclose(b, a, **same)


@pytest.mark.parametrize("changed", ["episodes", "leaps"])
def test_threads_look_for_themselves_where_times_differ(changed):
    """Worlds with clocks of their own, and stages that are told other commands than steps."""
    scene = Scene.load(shipped("scenes", "cell_delivery"))
    features = Simulation(scene, device="cpu").model.features
    features = dataclasses.replace(features, cached=False, phased=True, **{changed: True})
    assert make_step(features).phases.look is None


@pytest.mark.parametrize("name", ["touching", "cell_delivery"])
def test_phases_of_float64_follow_those_of_float32(name, device):
    """Their kernels, and what holds them, are other ones of the same source; traps and gates of the second move."""
    scene = touching_scene() if name == "touching" else Scene.load(shipped("scenes", name))
    narrow = stepped_as("phases", device, scene)
    wide = Simulation(scene, worlds=WORLDS, seed=31, device=device, precision="float64")
    step = kernel_module("step", "float64").make_step(
        dataclasses.replace(wide.model.features, cached=False, phased=True, team=1)
    )
    wide._stepper = PhasedStepper(StepperParts(step, wide.model, wide.state, wide.control, wide.last_readout))
    for sim in (narrow, wide):
        sim.step(20)
    np.testing.assert_allclose(wide.state.position.numpy(), narrow.state.position.numpy(), atol=1e-4)


@pytest.mark.parametrize("form", ["phases", "teams"])
def test_a_fault_stops_its_world_alone(form, device):
    """A world whose body has been thrown out keeps its state; the others go on as without it."""
    whole, faulty = (stepped_as(form, device) for _ in range(2))
    place = faulty.state.position.numpy().copy()
    place[2, 1, 0] = 2e9
    faulty.state.position.assign(place)
    whole.step(20)
    with pytest.raises(SimulationError) as error:
        faulty.step(20)
    assert (error.value.world, error.value.step) == (2, 0)
    assert faulty.last_readout.fault.numpy()[2, 1] == Fault.NON_FINITE
    np.testing.assert_array_equal(faulty.state.position.numpy()[2], place[2])
    others = [w for w in range(WORLDS) if w != 2]
    np.testing.assert_array_equal(faulty.state.position.numpy()[others], whole.state.position.numpy()[others])
