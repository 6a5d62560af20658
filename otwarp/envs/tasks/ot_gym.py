"""CellDeliveryOTGym: the cell delivery with the spaces of OT-Gym, the paper's companion: five numbers, ten strides.

Both hands move along one path; an action says by how much, ten of them, five times a second. Seen are the progress on
the path, the last stride, the distance of the cell from the middle of the pair, the yaw of the robots and their
offset from their traps. Rewards are of its kinds (progress, distance, contact force in a band, loss), with weights of
our own; and unlike there an episode ends where the cell is delivered, lost, or something is run into.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from otwarp.envs import terms as t
from otwarp.envs.experts.delivery import SPEED_LIMIT
from otwarp.envs.experts.strides import CHOICES, RATE, STRIDE, Strider
from otwarp.envs.task import Task
from otwarp.envs.tasks import cell_delivery
from otwarp.envs.tasks import terms as own
from otwarp.errors import InputError

BAND = (0.05, 10.0)
"""Contact force on the cell that is paid for [pN]."""


def task() -> Task:
    """What is simulated: actions are velocities of both hands, which `Strides` makes of strides."""
    base = cell_delivery.task()
    cell, left, right = cell_delivery.CELL, cell_delivery.LEFT, cell_delivery.RIGHT
    assert base.load().goal is not None
    return replace(
        base,
        name="otwarp/CellDeliveryOTGym-v0",
        description="Carry the cell along a path by one of ten strides, with the five numbers that OT-Gym sees.",
        observations=(
            t.body_offset(body=cell, other=left, axes="xy", name="left_offset"),
            t.body_offset(body=cell, other=right, axes="xy", name="right_offset"),
            t.body_axis(body=left, axis=(1.0, 0.0, 0.0), axes="xy", name="left_axis"),
            t.body_axis(body=right, axis=(-1.0, 0.0, 0.0), axes="xy", name="right_axis"),
            t.worst_lag(),
        ),
        rewards=(
            t.progress(body=cell, weight=0.1),
            own.carried_off(cell=cell, left=left, right=right, weight=-0.02),
            own.pressed(body=cell, low=BAND[0], high=BAND[1], weight=0.02),
            t.arrival(body=cell, radius=1.5, weight=10.0),
            own.dropped(cell=cell, left=left, right=right, distance=3.0, weight=-10.0),
            own.slip(distance=3.0, weight=-10.0),
        ),
        rate=RATE,
        time_limit=30.0,
        expert=Strider,
    )


def check(task: Task) -> None:
    """Refuse options by which its strides would not be what they say.

    Raises:
        InputError: There is one.
    """
    wanted = {"rate": RATE, "speed_limit": SPEED_LIMIT, "action": "velocity", "choices": ()}
    for option, value in wanted.items():
        if (given := getattr(task, option)) != value:
            raise InputError(f"{option} of {task.name} is {given!r}; allowed: {value!r}, of which its strides are made")


def wrap(env: Any) -> Any:
    """An `Env` or a `VectorEnv` of that task, with the spaces of OT-Gym."""
    from otwarp.envs.tasks.ot_gym_env import OTGym, OTGymVector

    kind = env.task.observation
    if kind != "state":
        raise InputError(f"observation of CellDeliveryOTGym is {kind!r}; allowed: state, the numbers of OT-Gym")
    return OTGymVector(env) if hasattr(env, "num_envs") else OTGym(env)


SEEN = (
    ("progress", "1", "Share of the path that is behind."),
    ("last_stride", "1", "The last choice, as share of the longest stride."),
    ("off_middle", "µm", "Distance of the cell from the middle of the two robots."),
    ("yaw", "rad", "Direction in which the pair of robots points."),
    ("worst_lag", "µm", "Largest distance of a held sphere from its trap's equilibrium point."),
)
"""What is seen, with units; none of it is scaled."""


def described() -> dict[str, list[dict[str, Any]]]:
    """Its five numbers and ten choices, as rows of tables."""
    seen = [{"name": name, "unit": unit, "scale": 1.0, "meaning": meaning} for name, unit, meaning in SEEN]
    meaning = "Way by which both hands go on along the path in the period."
    strides = [{"name": f"{n}", "unit": "µm", "scale": STRIDE * n, "meaning": meaning} for n in range(CHOICES)]
    return {"observations": seen, "actions": strides}
