"""What simulated operators are asked to do: the scene's paths with their hands, from its start to its goal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.haptics.core.config import RELEASE_GAIN
from otwarp.operators.population import Population
from otwarp.scene import Scene
from otwarp.simulation import ends
from otwarp.simulation.ends import End
from otwarp.teleop.operators import HandPlan, plan_hands, traps_of

DEVICE = "simulated operator"
"""What stands for the device of a hand."""
SPACING = 0.01
"""Seconds between the samples of a path."""
PRESSED = 0.5
"""Seconds of the author's time within which a hand has gone its additional way towards the cell."""
REACHED, ESCAPED, LEFT_BEHIND, TIMED_OUT = 1, 2, 3, 4
"""Codes of what ended a trial, in the order of `Task.ends`."""
OUTCOMES = {
    REACHED: "delivered",
    ESCAPED: "robot lost",
    LEFT_BEHIND: "cell left behind",
    TIMED_OUT: "not in time",
    -1: "no longer physical",
}
"""What ended a trial, in words."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Task:
    """A scene as a task for two hands, or one.

    Attributes:
        scene: The scene.
        plans: Its hands, with the gains of the task.
        path: (H, K, 3) way of each hand's traps from their start, every `SPACING` seconds of the author's time [µm].
        duration: After which a trial is given up [s].
        cell, left, right: Indices of the bodies of the goal.
        ends: What ends a trial; the codes above count them.
    """

    scene: Scene
    plans: tuple[HandPlan, ...]
    path: np.ndarray
    duration: float
    cell: int
    left: int
    right: int
    ends: tuple[End, ...]

    @property
    def motion_gain(self) -> float:
        """Of all hands [µm/m]."""
        return self.plans[0].config.motion_gain

    @property
    def end(self) -> float:
        """Duration of the path as its author has it [s]."""
        return (self.path.shape[1] - 1) * SPACING

    @property
    def contact_warning(self) -> float:
        """Force on the cell of which the scene warns [pN]."""
        return self.scene.bodies[self.cell].warning_force

    @property
    def distance_warning(self) -> float:
        """Distance between sphere and trap of which the scene warns [µm]."""
        assert self.scene.goal is not None
        return self.scene.goal.distance_warning


def task_of(
    scene: Scene,
    population: Population,
    *,
    mode: str = "stable",
    motion_gain: float | None = None,
    force_gain: float | None = None,
    duration: float | None = None,
    press: float = 0.0,
) -> Task:
    """The task that a scene sets.

    Args:
        scene: With a goal, a cell, two robots, and traps of hands that follow time samples.
        population: Whose `fixed` says what the workspace of a device is, and how long a trial may take.
        mode: Haptic chain, `stable` or `paper`.
        motion_gain: [µm/m]; None for the smallest that brings the path into the device's workspace.
        force_gain: [N/pN]; None for the chain's own.
        duration: After which a trial is given up [s]; None for so many times the author's.
        press: By how much farther towards the cell every hand takes its traps than their author [µm].

    Raises:
        InputError: The scene sets no such task, or an argument is out of range.
    """
    where = scene.file or scene.root
    goal = scene.goal
    if goal is None or len(goal.robots) != 2:
        raise InputError(f"{where}: has no goal with a cell and two robots; allowed: scenes as cell_delivery.usda")
    hands = [hand for hand in ("left", "right") if traps_of(scene, hand)]
    if not hands:
        raise InputError(f"{where}: no trap has ot:trap:hand = left or right; allowed: a scene with traps for hands")
    if mode == "paper" and force_gain is None:
        force_gain = RELEASE_GAIN
    planned = {hand: DEVICE for hand in hands}
    plans = plan_hands(scene, planned, mode=mode, motion_gain=motion_gain, force_gain=force_gain)
    path = np.stack([_path(scene, plan) for plan in plans])
    if press:
        path = path + press * np.stack([_inwards(scene, plan, path.shape[1]) for plan in plans])
    if motion_gain is None:
        gain = _motion_gain(path, plans, population)
        plans = plan_hands(scene, planned, mode=mode, motion_gain=gain, force_gain=force_gain)
    given_up = duration or population.fixed["patience"] * (path.shape[1] - 1) * SPACING
    names = [b.prim for b in scene.bodies]
    cell, left, right = (names.index(name) for name in (goal.cell, *goal.robots))
    ended = (
        ends.reached(goal=list(goal.position), radius=goal.tolerance, body=cell),
        ends.escaped,
        ends.left_behind(distance=goal.cell_lost_distance, cell=cell, left=left, right=right),
        ends.timed_out(after=given_up),
    )
    return Task(scene=scene, plans=plans, path=path, duration=given_up, cell=cell, left=left, right=right, ends=ended)


def _path(scene: Scene, plan: HandPlan) -> np.ndarray:
    """(K, 3) way of a hand: the mean of its traps' ways from their starts [µm]."""
    tracks = [scene.traps[t].position for t in plan.config.traps]
    last = max(float(track.times[-1]) for track in tracks)
    times = np.arange(round(last / SPACING) + 1) * SPACING
    way = np.mean([track.at_times(times) - track.at(0.0) for track in tracks], axis=0)
    if not np.any(way):
        where = scene.file or scene.root
        raise InputError(f"{where}: the traps of the {plan.name} hand stand still; allowed: traps that follow a path")
    return way


def _inwards(scene: Scene, plan: HandPlan, samples: int) -> np.ndarray:
    """(K, 3) unit way of a hand from its traps towards the goal's cell, gone after the first `PRESSED` seconds."""
    assert scene.goal is not None
    cell = next(np.array(b.position) for b in scene.bodies if b.prim == scene.goal.cell)
    way = cell - np.mean([scene.traps[t].position.at(0.0) for t in plan.config.traps], axis=0)
    way[2] = 0.0  # along the floor
    length = float(np.linalg.norm(way))
    if length == 0.0:
        where = scene.file or scene.root
        raise InputError(f"{where}: the traps of the {plan.name} hand are at the cell; allowed: press = 0")
    return np.minimum(np.arange(samples) * SPACING / PRESSED, 1.0)[:, None] * way / length


def _motion_gain(path: np.ndarray, plans: tuple[HandPlan, ...], population: Population) -> float:
    """Smallest gain with which the ways of all hands lie within their share of a device's workspace [µm/m]."""
    reach = population.fixed["reach_share"] * np.asarray(population.fixed["reach"], dtype=float)
    gains = []
    for way, plan in zip(path, plans, strict=True):
        on_device = way @ np.array(plan.config.axis_map)  # Aᵀ of each row
        gains.append(np.max(np.ptp(on_device, axis=0) / reach))
    return float(max(gains))
