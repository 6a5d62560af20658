"""Where a trap is for a body, and how far it reaches."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from otwarp.bench.scenes import ELEMENTS, HELD, PLACE, POWER, REACH, robot
from otwarp.kernels.core.types import ControlData, ModelData, Pose, StateData
from otwarp.kernels.optics.aims import aim_term, rest_aim_term
from otwarp.simulation.model import Model
from otwarp.simulation.state import Control, State
from tests.kernels.samples import evaluate


def aims(device: str, place: tuple[float, float, float]) -> list[np.ndarray]:
    """Anchor, power and squared reach of a robot's traps, one of which is dark: at rest, and seen from a place."""
    what = robot()
    traps = (what.traps[0], replace(what.traps[1], power=what.traps[1].power.constant(0.0)), what.traps[2])
    model = Model.build(replace(what, traps=traps), device=device)
    rest_aim, aim_at = rest_aim_term(model.features), aim_term(model.features)

    @wp.kernel(module="unique", enable_backward=False)
    def probe(
        model: ModelData, control: ControlData, state: StateData, place: wp.vec3, rest: wp.array(dtype=wp.vec4),
        rest_reach2: wp.array(dtype=wp.float32), seen: wp.array(dtype=wp.vec4), seen_reach2: wp.array(dtype=wp.float32),
    ):  # fmt: skip
        trap = wp.tid()
        a = rest_aim(model, control, 0, 0, trap)
        rest[trap] = wp.vec4(a.anchor[0], a.anchor[1], a.anchor[2], a.power)
        rest_reach2[trap] = a.reach2
        b = aim_at(model, control, state, 0, 0, Pose(place, wp.quat_identity()), trap, wp.float64(0.0))
        seen[trap] = wp.vec4(b.anchor[0], b.anchor[1], b.anchor[2], b.power)
        seen_reach2[trap] = b.reach2

    inputs = [model.data, Control.start(model).data(), State.start(model).data(), wp.vec3(*place)]
    return evaluate(probe, 3, inputs, [wp.vec4, wp.float32, wp.vec4, wp.float32], device)


@pytest.mark.parametrize("away", [0.0, 100.0])
def test_a_trap_reaches_where_it_is_lit_and_near(away, device):
    rest, rest_reach2, seen, seen_reach2 = aims(device, (PLACE[0], PLACE[1] + away, PLACE[2]))
    foci = np.array(PLACE) + [(ELEMENTS[i][0], 0.0, ELEMENTS[i][1]) for i in HELD]
    for found in (rest, seen):
        np.testing.assert_allclose(found[:, :3], foci, atol=1e-6)
        np.testing.assert_array_equal(found[:, 3], [POWER, 0.0, POWER])
    lit = np.array([REACH**2, 0.0, REACH**2])
    np.testing.assert_allclose(rest_reach2, lit, rtol=1e-6)
    # the bounding sphere of the body is not within reach of any
    np.testing.assert_allclose(seen_reach2, lit if away == 0.0 else 0.0, rtol=1e-6)
