"""How a step of a world ends: every body takes its move, unless one has a fault, and escapes are recorded."""

import warp as wp

from otwarp.kernels.core.faults import Fault, finite, raise_fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.periodic import kept_in_cell
from otwarp.kernels.core.rotation import rotate_by
from otwarp.kernels.core.team import team_of
from otwarp.kernels.core.types import ControlData, ModelData, Pose, ReadoutData, StateData
from otwarp.kernels.drivers.inlets import let_all_in_term
from otwarp.kernels.drivers.world_room import BodyRoom
from otwarp.kernels.hydrodynamics.walls import out_of_walls
from otwarp.kernels.optics.escapes import escape_term, trap_escape_term


def all_good_term(f: Features) -> wp.Function:
    """`(readout, world, body, step) -> bool`: whether the step may be taken."""
    team = team_of(f)
    size_of, lane_of, votes_of = team.size, team.lane, team.votes

    @wp.func
    def all_good(readout: ReadoutData, world: int, body: BodyRoom, step: wp.int64) -> bool:
        """Whether every move is finite and no body of the world has a fault."""
        good = bool(True)
        bodies = int(wp.static(f.bodies))
        for b in range(lane_of(), bodies, size_of()):
            if not finite(body.position[b] + body.linear[b] + body.angular[b]):
                raise_fault(readout, world, b, wp.static(int(Fault.NON_FINITE)), step)
            if readout.fault[world, b] != 0:
                good = False
        return votes_of(not good) == 0

    return all_good


def arrived_term(f: Features) -> wp.Function:
    """`(model, b, body) -> Pose` of body b where its move [µm, rad] takes it."""

    @wp.func
    def arrived(model: ModelData, b: int, body: BodyRoom) -> Pose:
        """Pose at the end of the step, outside hydrodynamic walls."""
        pose = Pose(body.position[b], body.rotation[b])
        pose.position = pose.position + body.linear[b]
        if wp.static(f.rigid):
            pose.rotation = rotate_by(pose.rotation, body.angular[b])
        if wp.static(f.walls > 0):
            pose.position = pose.position + out_of_walls(model.walls, b, pose)
        return pose

    return arrived


def take_moves_term(f: Features) -> wp.Function:
    """`(model, control, state, readout, world, body, step)`: arrive at `step`."""
    record_escapes, record_escape = (escape_term(f), trap_escape_term(f)) if f.escapes else (None, None)
    let_all_in = let_all_in_term(f) if f.inlet else None
    arrived, team = arrived_term(f), team_of(f)
    size_of, lane_of, wait = team.size, team.lane, team.wait

    @wp.func
    def watch_traps(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, world: int, body: BodyRoom,
        step: wp.int64, time: wp.float64,
    ):  # fmt: skip
        """Record escapes before bodies move; each thread of the team looks after other traps."""
        for trap in range(lane_of(), model.traps.axis.shape[0], size_of()):
            b = model.traps.held_body[trap]
            if b >= 0:
                before = Pose(body.position[b], body.rotation[b])
                record_escape(
                    model, control, state, readout, world, trap, before, arrived(model, b, body), step, time
                )  # fmt: skip

    @wp.func
    def take_moves(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, world: int, body: BodyRoom,
        step: wp.int64,
    ):  # fmt: skip
        """Move and turn all bodies by their moves [µm, rad], and record escapes."""
        position = body.position
        rotation = body.rotation
        bodies = int(wp.static(f.bodies))
        time = wp.float64(step) * model.time_step
        if wp.static(f.escapes and f.team > 1):
            watch_traps(model, control, state, readout, world, body, step, time)
            wait()
        for b in range(lane_of(), bodies, size_of()):
            before = Pose(position[b], rotation[b])
            pose = arrived(model, b, body)
            position[b] = pose.position
            if wp.static(f.rigid):
                rotation[b] = pose.rotation
            if wp.static(f.escapes and f.team == 1):
                record_escapes(model, control, state, readout, world, b, before, pose, step, time)
            if wp.static(f.periodic):
                position[b] = kept_in_cell(model, state, world, b, position[b])
        if wp.static(f.inlet):
            wait()
            if lane_of() == 0:
                let_all_in(model, state, readout, world, body.position, step)

    return take_moves


def finish_term(f: Features) -> wp.Function:
    """`(model, control, state, readout, world, body, step) -> bool`: end a step, unless a body has a fault."""
    all_good, take_moves = all_good_term(f), take_moves_term(f)

    @wp.func
    def finish(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, world: int, body: BodyRoom,
        step: wp.int64,
    ) -> bool:  # fmt: skip
        """Take the moves of the step; false, and nothing moved, if a body of the world has a fault."""
        good = all_good(readout, world, body, step)
        if good:
            take_moves(model, control, state, readout, world, body, step + wp.int64(1))
        return good

    return finish
