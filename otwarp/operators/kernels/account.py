"""From the chain's commands to the traps, and what is kept of a simulated operator's trial."""

import warp as wp

from otwarp.kernels.core.types import ControlData, ModelData, ReadoutData, StateData
from otwarp.operators.kernels.seen import distance_of
from otwarp.operators.kernels.types import AccountData, MindData, TaskData


@wp.kernel(enable_backward=False)
def command(
    task: TaskData, done: wp.array(dtype=wp.int32), commanded: wp.array2d(dtype=wp.vec3d), control: ControlData
):
    """Put the traps of hands where the chain commands them [µm], in worlds that are in motion."""
    world, trap = wp.tid()
    if done[world] == 0 and task.hand_of[trap] >= 0:
        control.trap_position[world, trap] = wp.vec3(commanded[world, trap])


@wp.kernel(enable_backward=False)
def account_for(
    model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, task: TaskData, mind: MindData,
    cell: int, contact_warning: float, distance_warning: float, account: AccountData,
):  # fmt: skip
    """Add a servo period to what is kept of each trial that has gone on in it."""
    world = wp.tid()
    if account.counted[world] == mind.tick[world]:
        return
    account.counted[world] = mind.tick[world]
    load = float(0.0)
    if readout.contact_load.shape[1] > 0:
        load = readout.contact_load[world, cell]
    account.contact[world] = account.contact[world] + wp.float64(load)
    account.contact_peak[world] = wp.max(account.contact_peak[world], wp.float64(load))
    if load > contact_warning:
        account.contact_above[world] = account.contact_above[world] + 1
    total, most, count = float(0.0), float(0.0), int(0)
    for t in range(task.hand_of.shape[0]):
        if task.hand_of[t] >= 0 and model.traps.held_body[t] >= 0:
            distance = distance_of(model, control, state, world, t)
            total, most, count = total + distance, wp.max(most, distance), count + 1
    mean = total / float(wp.max(count, 1))
    account.distance[world] = account.distance[world] + wp.float64(mean)
    account.distance_peak[world] = wp.max(account.distance_peak[world], wp.float64(most))
    if mean > distance_warning:
        account.distance_above[world] = account.distance_above[world] + 1
