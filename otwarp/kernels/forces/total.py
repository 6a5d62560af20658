"""All forces on a body that are not contact: the sum of the active rows of `FORCES`."""

from functools import reduce

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.step_constants import BeadConstants, RigidConstants
from otwarp.kernels.core.types import ControlData, ModelData, Pose, StateData, Wrench, mat66
from otwarp.kernels.forces.table import active_forces
from otwarp.kernels.forces.zeros import ZEROS, no_body_stiffness, no_wrench


def sphere_total(f: Features, what: str) -> wp.Function:
    """`(model, control, state, bead, world, b, position, time)` → total `force` [pN] or `stiffness` [pN/µm]."""
    rows = active_forces(f)
    made = [make for row in rows if (make := row.on_sphere if what == "force" else row.sphere_stiffness)]
    kind, nothing = ZEROS[what]

    @wp.func
    def zero(
        model: ModelData, control: ControlData, state: StateData, bead: BeadConstants, world: int, b: int,
        position: wp.vec3, time: wp.float64,
    ) -> kind:  # fmt: skip
        """The empty sum [pN, pN·µm or pN/µm]: no force of `FORCES` is active."""
        return nothing()

    def both(one: wp.Function, other: wp.Function) -> wp.Function:
        """The sum of two terms, with the arguments of each."""

        @wp.func
        def total(
            model: ModelData, control: ControlData, state: StateData, bead: BeadConstants, world: int, b: int,
            position: wp.vec3, time: wp.float64,
        ) -> kind:  # fmt: skip
            """Sum of the rows so far and the next row, in the order of the table."""
            value = one(model, control, state, bead, world, b, position, time)
            value += other(model, control, state, bead, world, b, position, time)
            return value

        return total

    terms = [make(f) for make in made]
    return reduce(both, terms) if terms else zero


def body_total(f: Features) -> wp.Function:
    """`(model, control, state, body, world, b, pose, time) -> Wrench`: total force and torque on a rigid body."""

    @wp.func
    def zero(
        model: ModelData, control: ControlData, state: StateData, body: RigidConstants, world: int, b: int, pose: Pose,
        time: wp.float64,
    ) -> Wrench:  # fmt: skip
        """The empty sum [pN, pN·µm or pN/µm]: no force of `FORCES` is active."""
        return no_wrench()

    def both(one: wp.Function, other: wp.Function) -> wp.Function:
        """The sum of two terms, with the arguments of each."""

        @wp.func
        def total(
            model: ModelData, control: ControlData, state: StateData, body: RigidConstants, world: int, b: int,
            pose: Pose, time: wp.float64,
        ) -> Wrench:  # fmt: skip
            """Sum of the rows so far and the next row, in the order of the table."""
            value = one(model, control, state, body, world, b, pose, time)
            more = other(model, control, state, body, world, b, pose, time)
            value.force += more.force
            value.torque += more.torque
            return value

        return total

    terms = [row.on_body(f) for row in active_forces(f) if row.on_body]
    return reduce(both, terms) if terms else zero


def body_stiffness_total(f: Features) -> wp.Function:
    """`(model, control, state, world, b, pose, time) -> (6, 6)` symmetric part of −∂(F, T)/∂(x, θ) on a rigid body."""

    @wp.func
    def zero(
        model: ModelData, control: ControlData, state: StateData, world: int, b: int, pose: Pose, time: wp.float64
    ) -> mat66:
        """The empty sum [pN/µm, pN, pN·µm]: no force has a part that the exponential integrator treats as linear."""
        return no_body_stiffness()

    def both(one: wp.Function, other: wp.Function) -> wp.Function:
        """The sum of two terms, with the arguments of each."""

        @wp.func
        def total(
            model: ModelData, control: ControlData, state: StateData, world: int, b: int, pose: Pose, time: wp.float64
        ) -> mat66:
            """Sum of the rows so far and the next row, in the order of the table."""
            value = one(model, control, state, world, b, pose, time)
            value += other(model, control, state, world, b, pose, time)
            return value

        return total

    terms = [row.body_stiffness(f) for row in active_forces(f) if row.body_stiffness]
    return reduce(both, terms) if terms else zero
