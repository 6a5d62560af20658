"""The body driver: one thread per body and step, neighbours from a hash grid, for scenes with many touching bodies.

A step is: `advance` (free displacements), a build of the grid, `find` (each body lists its contacts), `weigh` and
sweeps of `relax` (contact forces from the displacements of both partners) and `commit` (apply, and place the spheres
for the next build); see `grid_contacts` for the three in between. All steps and worlds use the same launches, so a
step is captured in a graph; the step counter lives in device memory.
"""

import warp as wp

from otwarp.kernels.body import free_move_term, move_trap_term
from otwarp.kernels.escapes import escape_term
from otwarp.kernels.faults import Fault, finite, raise_fault
from otwarp.kernels.features import Features
from otwarp.kernels.grid_data import GridData, PushData, body_pose_term
from otwarp.kernels.rotation import rotate_by
from otwarp.kernels.types import ControlData, ModelData, ReadoutData, StateData


def make_advance(f: Features) -> wp.Kernel:
    """Kernel over (world, body): free displacement of this step."""
    free_move = free_move_term(f)
    body_pose = body_pose_term(f)

    @wp.kernel(module="unique", enable_backward=False, module_options={"fast_math": f.fast_math})
    def advance(model: ModelData, control: ControlData, state: StateData, grid: GridData):
        """One body's free move."""
        world, b = wp.tid()
        step = grid.clock[0]
        pose = body_pose(state, world, b)
        move = free_move(model, control, state, world, b, pose, step, wp.float64(step) * model.time_step)
        grid.linear[world, b] = move.linear
        if wp.static(f.rigid):
            grid.angular[world, b] = move.angular

    return advance


def make_commit(f: Features) -> wp.Kernel:
    """Kernel over (world, body): apply the displacements unless the body has a fault, place its spheres."""
    note_escapes = escape_term(f) if f.escapes else None
    body_pose = body_pose_term(f)

    @wp.kernel(module="unique", enable_backward=False, module_options={"fast_math": f.fast_math})
    def commit(
        model: ModelData,
        control: ControlData,
        state: StateData,
        readout: ReadoutData,
        grid: GridData,
        push: PushData,
    ):
        """One body's new pose, and where that puts its spheres."""
        world, b = wp.tid()
        step = grid.clock[0]
        pose = body_pose(state, world, b)
        linear = grid.linear[world, b]
        angular = wp.vec3(0.0)
        if wp.static(f.contacts):
            linear += push.linear[world, b]
        if wp.static(f.rigid):
            angular = grid.angular[world, b]
            if wp.static(f.contacts):
                angular += push.angular[world, b]
        if not finite(pose.position + linear + angular):
            raise_fault(readout, world, b, wp.static(int(Fault.NON_FINITE)), step)
        if readout.fault[world, b] == 0:
            pose.position = pose.position + linear
            state.position[world, b] = pose.position
            if wp.static(f.rigid):
                pose.rotation = rotate_by(pose.rotation, angular)
                state.orientation[world, b] = pose.rotation
        if wp.static(f.escapes):
            time = wp.float64(step + wp.int64(1)) * model.time_step
            note_escapes(model, control, state, readout, world, b, pose, step + wp.int64(1), time)
        if wp.static(f.pairs):
            spheres = model.contact.sphere.shape[0]
            for i in range(model.contact.start[b], model.contact.start[b + 1]):
                s = model.contact.sphere[i]
                grid.centre[world * spheres + i] = pose.position + wp.quat_rotate(
                    pose.rotation, wp.vec3(s[0], s[1], s[2])
                )

    return commit


def make_move_traps(f: Features) -> wp.Kernel:
    """Kernel over (world, trap): move the foci towards their commands within their speed limits."""
    move_trap = move_trap_term(f)

    @wp.kernel(module="unique", enable_backward=False, module_options={"fast_math": f.fast_math})
    def move_traps(model: ModelData, control: ControlData, state: StateData, grid: GridData):
        """One focus."""
        world, trap = wp.tid()
        move_trap(model, control, state, world, trap, wp.float64(grid.clock[0]) * model.time_step)

    return move_traps


@wp.kernel(enable_backward=False)
def tick(grid: GridData):
    """Count one step."""
    grid.clock[0] = grid.clock[0] + wp.int64(1)


@wp.kernel(enable_backward=False)
def place_spheres(model: ModelData, state: StateData, grid: GridData, rigid: int):
    """Centres of all colliding spheres from the present poses: before the first build, and after a restore."""
    world, b = wp.tid()
    rotation = wp.quat_identity()
    if rigid != 0:
        rotation = state.orientation[world, b]
    spheres = model.contact.sphere.shape[0]
    for i in range(model.contact.start[b], model.contact.start[b + 1]):
        s = model.contact.sphere[i]
        arm = wp.quat_rotate(rotation, wp.vec3(s[0], s[1], s[2]))
        grid.centre[world * spheres + i] = state.position[world, b] + arm
        grid.group[world * spheres + i] = world
