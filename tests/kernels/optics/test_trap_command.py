"""Where traps are: as commanded, or held back by their speed limit."""

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.core.types import ControlData, ModelData, StateData
from otwarp.kernels.optics.trap_command import anchor_of, move_trap_term, trap_command_term
from otwarp.simulation.model import Model
from otwarp.simulation.state import Control, State
from tests.kernels.optics.test_traps import SCENE, TRAPS


def test_traps_go_where_they_are_commanded_as_fast_as_they_may(device):
    model = Model.build(SCENE, device=device)
    command, move = trap_command_term(model.features), move_trap_term(model.features)

    @wp.kernel(module="unique", enable_backward=False)
    def probe(
        model: ModelData,
        control: ControlData,
        state: StateData,
        time: wp.float64,
        now: wp.array(dtype=wp.vec4),
        anchor: wp.array(dtype=wp.vec3),
    ):
        t = wp.tid()
        now[t] = command(model, control, state, 0, t, time)
        anchor[t] = anchor_of(model, t, now[t])
        move(model, control, state, 0, t, time)

    state, control = State.start(model), Control.start(model)
    before = state.trap_position.numpy()[0].copy()
    now = wp.zeros(len(TRAPS), dtype=wp.vec4, device=device)
    anchor = wp.zeros(len(TRAPS), dtype=wp.vec3, device=device)
    inputs = [model.data, control.data(), state.data(), wp.float64(0.25), now, anchor]
    wp.launch(probe, dim=len(TRAPS), inputs=inputs, device=device)
    after = state.trap_position.numpy()[0]
    moved = np.linalg.norm(after - before, axis=1)
    for n, trap in enumerate(TRAPS):
        limited = np.isfinite(trap.speed_limit)
        place = before[n] if limited else trap.position.at(0.25)
        assert now.numpy()[n, :3] == pytest.approx(place, abs=1e-5)
        assert now.numpy()[n, 3] == pytest.approx(trap.power.at(0.25)[0], rel=1e-5)
        assert np.linalg.norm(anchor.numpy()[n] - now.numpy()[n, :3]) == pytest.approx(abs(trap.equilibrium), abs=1e-5)
        wanted = trap.position.at(0.25 + model.time_step)
        if limited:
            assert moved[n] == pytest.approx(
                min(trap.speed_limit * model.time_step, np.linalg.norm(wanted - before[n])), rel=1e-3, abs=1e-6
            )
        else:
            assert after[n] == pytest.approx(wanted, abs=1e-5)
