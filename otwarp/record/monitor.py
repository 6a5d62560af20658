"""`Monitor`: whether the cell was delivered or something was lost, when and why, frame by frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from otwarp.record.statistics import RunningStatistics
from otwarp.scene import Scene
from otwarp.simulation.frame import Frame

UNDECIDED, DELIVERED, ROBOT_LOST, CELL_LOST = range(4)
OUTCOMES = ("undecided", "delivered", "robot lost", "cell lost")
"""Names of the outcome codes."""

GRACE = 0.1
"""Time [s] a trap may be too far from its sphere before the robot counts as lost: a jump may be caught again."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """How the task ended in one world: its name in `OUTCOMES`, when [s] (None while undecided), and a sentence."""

    world: int
    outcome: str
    time: float | None
    reason: str


class Monitor:
    """Judges the task of a scene and keeps running statistics; its memory does not grow with the run.

    A world is *delivered* the first time its cell is within the goal's tolerance. Before that, a *robot is lost* when
    one of its lit traps stays further than `lost_distance` from the sphere it holds (or holds none) for longer than
    the grace, or when all its traps are dark for that long; the *cell is lost* when it is further than
    `cell_lost_distance` from the midpoint of its robots. The first of these decides, and the statistics of a world
    stop there: what a trap does after it has lost its robot says nothing about carrying.

    Attributes:
        robots: Body indices of the robots.
        cells: Body indices of the monitored cells: the goal's, or all.
        traps_of: Per robot, the indices of the traps that hold it.
        distance: Per (world, robot): the largest robot–trap distance over the robot's lit traps [µm].
        touching: Whether anything can touch; without, contact forces are 0 and say nothing.
        force: Per (world, robot): magnitude of the net contact force [pN].
        load: Per (world, monitored cell): sum of the normal forces on it [pN].
        entries: How often cells have come in again at the inlet, in all worlds since the start; None without one.
        escape_time: (W, T) when the sphere that a lit trap holds was first out of its reach [s], nan if it never was.
            The device looks at every step, so that an escape between two frames counts as well.

    Args:
        scene: What is being run; without a goal there are statistics only.
        held: Per trap the index of the body it holds and of the sphere in it, -1 for none.
        worlds: Number of worlds.
        grace: See `GRACE` [s].
    """

    def __init__(self, scene: Scene, held: Sequence[tuple[int, int]], worlds: int, *, grace: float = GRACE):
        self.scene, self.goal, self.grace = scene, scene.goal, grace
        self.held = np.array(held, dtype=int).reshape(-1, 2)
        prims = [b.prim for b in scene.bodies]
        if self.goal is None:
            self.robots = [i for i, b in enumerate(scene.bodies) if b.kind == "robot"]
            self.cells = [i for i, b in enumerate(scene.bodies) if b.kind == "cell"]
        else:
            self.robots = [prims.index(p) for p in self.goal.robots]
            self.cells = [prims.index(self.goal.cell)]
        self.traps_of = [np.flatnonzero(self.held[:, 0] == r) for r in self.robots]
        self._force_line = force_line(scene, self.cells, self.robots)
        self._load_line = np.array([scene.bodies[c].warning_force for c in self.cells])
        self.touching = can_touch(scene)
        self.distance = RunningStatistics((worlds, len(self.robots)))
        self.force = RunningStatistics((worlds, len(self.robots)))
        self.load = RunningStatistics((worlds, len(self.cells)))
        self.escape_time = np.full((worlds, len(self.held)), np.nan)
        self.entries: int | None = None
        self._began = np.nan
        self._code = np.zeros(worlds, dtype=np.int8)
        self._when = np.full(worlds, np.nan)
        self._who = np.full(worlds, -1)
        self._value = np.full(worlds, np.nan)
        self._since = np.full((worlds, len(self.robots)), np.inf)

    @property
    def warning_force(self) -> np.ndarray:
        """(robots,) warning line of the contact force [pN], inf for none."""
        return self._force_line

    @property
    def warning_distance(self) -> float:
        """Warning line of the robot–trap distance [µm], inf without a goal."""
        return self.goal.distance_warning if self.goal else np.inf

    @property
    def warning_load(self) -> np.ndarray:
        """(monitored cells,) warning line of the load on a cell [pN], inf for none."""
        return self._load_line

    def update(self, frame: Frame) -> None:
        """Take one frame; frames come in order of time."""
        open_ = (self._code == UNDECIDED)[:, None]
        distance = robot_distance(frame.trap_distance, frame.trap_power, self.traps_of)
        force = np.linalg.norm(frame.contact_force[:, self.robots], axis=2)
        self.distance.add(distance, where=open_, limit=self.warning_distance)
        self.force.add(force, where=open_, limit=self._force_line)
        self.load.add(frame.contact_load[:, self.cells], where=open_, limit=self._load_line)
        self._note_escapes(frame, open_)
        if frame.entries is not None:
            self.entries = int(frame.entries.sum())
        if self.goal is not None:
            self._judge(frame, distance)

    def _note_escapes(self, frame: Frame, open_: np.ndarray) -> None:
        if np.isnan(self._began):
            self._began = frame.time
        # a resumed run brings the escapes of the run before it along
        new = open_ & (frame.escape_time >= self._began)
        self.escape_time = np.where(new, frame.escape_time, self.escape_time)

    def _judge(self, frame: Frame, distance: np.ndarray) -> None:
        goal, cell = self.goal, frame.position[:, self.cells[0]]
        assert goal is not None
        away = np.linalg.norm(cell - goal.position, axis=1)
        self._decide(away <= goal.tolerance, DELIVERED, frame.time, -1, away)
        if self.robots:
            # a robot without a lit trap has the distance inf; one that no trap was ever meant to hold is not judged
            far = ~(distance <= goal.lost_distance) & [len(t) > 0 for t in self.traps_of]
            self._since = np.where(far, np.minimum(self._since, frame.time), np.inf)
            lost = frame.time - self._since > self.grace
            first = np.argmax(lost, axis=1)
            rows = np.arange(len(lost))
            self._decide(lost.any(axis=1), ROBOT_LOST, self._since[rows, first], first, distance[rows, first])
            off = np.linalg.norm(cell - frame.position[:, self.robots].mean(axis=1), axis=1)
            self._decide(off > goal.cell_lost_distance, CELL_LOST, frame.time, -1, off)

    def _decide(
        self, now: np.ndarray | np.bool_, code: int, time: np.ndarray | float, who: np.ndarray | int, value: np.ndarray
    ) -> None:
        new = now & (self._code == UNDECIDED)
        self._code[new] = code
        self._when[new] = np.broadcast_to(time, new.shape)[new]
        self._who[new] = np.broadcast_to(who, new.shape)[new]
        self._value[new] = value[new]

    def counts(self) -> dict[str, int]:
        """How many worlds ended in which way."""
        return {name: int((self._code == code).sum()) for code, name in enumerate(OUTCOMES)}

    def times(self, outcome: str) -> np.ndarray:
        """Times [s] at which worlds came to an outcome, in order of worlds."""
        return self._when[self._code == OUTCOMES.index(outcome)]

    def outcome(self, world: int) -> Outcome:
        """How the task ended in one world."""
        code, goal = int(self._code[world]), self.goal
        if goal is None:
            return Outcome(world=world, outcome="undecided", time=None, reason="the scene has no goal")
        if code == UNDECIDED:
            reason = f"{goal.cell} neither reached the goal nor was anything lost"
            return Outcome(world=world, outcome="undecided", time=None, reason=reason)
        when, value = float(self._when[world]), float(self._value[world])
        if code == DELIVERED:
            reason = f"{goal.cell} came within {value:.3g} µm of the goal (tolerance {goal.tolerance:g} µm)"
        elif code == ROBOT_LOST:
            robot = self.scene.bodies[self.robots[self._who[world]]].name
            far = f"a trap of {robot} was {value:.3g} µm from the sphere it holds (limit {goal.lost_distance:g} µm)"
            reason = far if np.isfinite(value) else f"no trap holds {robot} any more"
        else:
            reason = (
                f"{goal.cell} was {value:.3g} µm from the midpoint of its robots (limit {goal.cell_lost_distance:g} µm)"
            )
        return Outcome(world=world, outcome=OUTCOMES[code], time=when, reason=reason)


def robot_distance(trap_distance: np.ndarray, trap_power: np.ndarray, traps_of: Sequence[np.ndarray]) -> np.ndarray:
    """Robot–trap distance: the largest over a robot's lit traps.

    Args:
        trap_distance: (..., T) [µm], nan where a trap holds nothing.
        trap_power: (..., T) [mW]; a trap of no power is dark.
        traps_of: Per robot, the indices of its traps.

    Returns:
        (..., robots) µm; inf where a lit trap holds nothing or all are dark, nan for a robot without traps.
    """
    out = np.full((*trap_distance.shape[:-1], len(traps_of)), np.nan)
    for n, traps in enumerate(traps_of):
        if len(traps):
            lit = trap_power[..., traps] > 0.0
            far = np.where(np.isnan(trap_distance[..., traps]), np.inf, trap_distance[..., traps])
            largest = np.where(lit, far, -np.inf).max(axis=-1)
            out[..., n] = np.where(lit.any(axis=-1), largest, np.inf)
    return out


def force_line(scene: Scene, cells: Sequence[int], robots: Sequence[int]) -> np.ndarray:
    """(robots,) warning line of a robot's contact force [pN]: its own, or that of the cell it carries if lower."""
    cell = min((scene.bodies[c].warning_force for c in cells), default=np.inf) if scene.goal else np.inf
    return np.array([min(scene.bodies[r].warning_force, cell) for r in robots])


def can_touch(scene: Scene) -> bool:
    """Whether anything in the scene can touch anything: two colliding bodies, or one and an obstacle."""
    colliding = sum(bool(body.colliding) for body in scene.bodies)
    return colliding > 1 or (colliding == 1 and len(scene.obstacles) > 0)
