"""Simulated operators on the device: their constants, what they see, remember and do, and what is kept of a trial."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.operators.kernels.types import (
    CORRECTED,
    PLANNED,
    AccountData,
    MindData,
    Person,
    SightData,
    TaskData,
)
from otwarp.operators.population import Population
from otwarp.operators.task import SPACING, Task
from otwarp.simulation.model import Model

ACCOUNT_TYPES = {"counted": wp.int32, "contact_above": wp.int32, "distance_above": wp.int32, "waited": wp.int32,
                 "slowed": wp.int32}  # fmt: skip
"""Fields of `AccountData` that count; the others are float64."""


def periods(seconds: np.ndarray, period: float) -> np.ndarray:
    """Whole servo periods nearest to times [s], at least 1."""
    return np.maximum(np.rint(np.asarray(seconds) / period), 1).astype(np.int32)


def arm_turn(mass: np.ndarray, damping: np.ndarray, stiffness: np.ndarray, period: float) -> np.ndarray:
    """(n, 4) rows of exp(A·T), A = ((0, 1), (−k/m, −b/m)): what the arm's deviation and velocity become in a period T.

    By the closed form of a 2×2 exponential, for any damping: exp(A·T) = e^{−aT}(c·1 + s·(A + a·1)), a = b/2m, with
    c = cos ωT, s = sin(ωT)/ω for ω² = k/m − a² > 0, and cosh, sinh for ω² < 0.
    """
    a = damping / (2.0 * mass)
    square = stiffness / mass - a * a
    w = np.sqrt(np.abs(square) + 0.0)
    turn = np.maximum(w * period, 1e-12)
    c = np.where(square > 0.0, np.cos(turn), np.cosh(turn))
    s = np.where(square > 0.0, np.sin(turn), np.sinh(turn)) / turn * period
    decay = np.exp(-a * period)
    rows = [c + s * a, s, -s * stiffness / mass, c - s * a]
    return np.stack([decay * row for row in rows], axis=1)


def persons(
    population: Population, values: np.ndarray, task: Task, period: float, *, number: np.ndarray, feels: np.ndarray
) -> np.ndarray:
    """(W) structs `Person` of operators.

    Args:
        population: Which column of `values` is what.
        values: (W, parameters).
        task: For its motion gain.
        period: Of the servo [s].
        number: (W) keys of their random numbers.
        feels: (W) what a force does to each: a constant of `kernels.types`.

    Raises:
        InputError: Delays and submovements of which more would be under way at once than there is room for.
    """
    p: Mapping[str, np.ndarray] = {name: values[:, i] for i, name in enumerate(population.names)}
    _check_room(p)
    out = np.zeros(len(values), dtype=np.dtype(Person.numpy_dtype()))  # type: ignore[arg-type]
    lead = np.minimum(p["preview"], 0.5 * (p["duration"] + p["interval"]))
    rows: dict[str, Any] = {
        "number": number,
        "feels": feels,
        "visual_delay": periods(p["visual_delay"], period),
        "response_delay": periods(p["response_delay"], period),
        "correction_interval": periods(p["interval"], period),
        "lead": lead,
        "horizon": p["duration"] + p["preview"],
        "lag": p["hand_lag"],
        "correction": -np.expm1(-p["crossover"] * p["interval"]),
        "noise": p["motor_noise"],
        "common": p["noise_correlation"],
        "threshold": p["visual_threshold"] / task.motion_gain,
        "difference": p["force_difference"],
        "onset": p["response_onset"],
        "span": np.full(len(values), float(population.fixed["response_span"])),
        "turn": arm_turn(p["mass"], p["damping"], p["stiffness"], period),
    }
    rows |= {name: p[name] for name in ("interval", "duration", "pace", "clearance", "lag_threshold", "stiffness")}
    for name, row in rows.items():
        out[name] = row
    return out


def _check_room(p: Mapping[str, np.ndarray]) -> None:
    """Refuse operators with more submovements under way at once than the kernels remember."""
    planned = np.ceil(p["duration"] / p["interval"]) + 1
    corrected = np.ceil((p["duration"] + p["visual_delay"]) / p["interval"]) + 1
    if np.any(planned > PLANNED) or np.any(corrected > CORRECTED):
        raise InputError(
            f"population: {int(planned.max())} submovements and {int(corrected.max())} corrections at once; "
            f"allowed: {PLANNED} and {CORRECTED}"
        )


class People:
    """Simulated operators of all worlds of a simulation.

    Args:
        task: What they do.
        model: The simulation's.
        rows: (W) structs of `persons`.
        seed: Key of the random numbers.
        period: Of the servo [s].

    Attributes:
        task: `TaskData`, `people`: (W) `Person`, `sight`: `SightData`, `mind`: `MindData`, `account`: `AccountData`.
    """

    def __init__(self, task: Task, model: Model, rows: np.ndarray, seed: int, period: float):
        self.device = model.device
        self.period = period
        worlds, hands = len(rows), len(task.plans)
        self.people = wp.array(rows, dtype=Person, device=self.device)
        self.task = task_data(task, model, seed, period)
        ring = int(max(rows["visual_delay"].max(), rows["response_delay"].max())) + 1
        self.sight = self._zeros(SightData, {"error": (worlds, hands), "lag": (worlds,)})
        self.mind = self._zeros(MindData, _mind_shapes(worlds, hands, ring))
        self.account = self._zeros(AccountData, {name: (worlds,) for name in AccountData.vars})

    def _zeros(self, struct: Any, shapes: Mapping[str, tuple[int, ...]]) -> Any:
        """A struct of arrays of zeros."""
        data = struct()
        for name, shape in shapes.items():
            dtype = struct.vars[name].type.dtype
            setattr(data, name, wp.zeros(shape, dtype=dtype, device=self.device))
        return data

    def accounts(self) -> dict[str, np.ndarray]:
        """By name what was kept of each trial, (W), on the host; see `AccountData`."""
        return {name: getattr(self.account, name).numpy().copy() for name in AccountData.vars}


def _mind_shapes(worlds: int, hands: int, ring: int) -> dict[str, tuple[int, ...]]:
    """Shapes of the arrays of `MindData`."""
    each = ("tick", "clock", "next_plan", "plans", "corrections", "progress", "aim", "goes", "noticed")
    of_hand = ("meant_before", "made_before", "aimed", "aimed_late", "wanted", "deviation", "velocity", "position")
    return {
        **dict.fromkeys(each, (worlds,)),
        **dict.fromkeys(of_hand, (worlds, hands)),
        "began": (worlds, PLANNED),
        "corrected": (worlds, CORRECTED),
        **dict.fromkeys(("meant", "made"), (worlds, hands, PLANNED)),
        **dict.fromkeys(("sent", "given"), (worlds, hands, CORRECTED)),
        "errors": (ring, worlds, hands),
        **dict.fromkeys(("lags", "forces"), (ring, worlds)),
    }


def task_data(task: Task, model: Model, seed: int, period: float) -> Annotated[Any, TaskData]:
    """A task as the struct that kernels take."""
    scene, device = task.scene, model.device
    maps = [np.array(plan.config.axis_map) for plan in task.plans]
    paths = np.stack([way @ a for way, a in zip(task.path, maps, strict=True)]) / task.motion_gain
    hand_of = np.full(len(scene.traps), -1, dtype=np.int32)
    for h, plan in enumerate(task.plans):
        hand_of[list(plan.config.traps)] = h
    held = model.data.traps.held_body.numpy()
    carried = {int(held[t]): int(h) for t, h in enumerate(hand_of) if h >= 0 and held[t] >= 0} | {task.cell: 0}
    data = TaskData()
    data.seed, data.period, data.spacing, data.end = seed, period, SPACING, task.end
    data.gain = task.motion_gain
    names = [plan.name for plan in task.plans]
    data.lagging = names.index("left") if len(names) > 1 else -1
    data.path = wp.array(paths, dtype=wp.vec3d, device=device)
    data.axes = wp.array(np.stack(maps), dtype=wp.mat33d, device=device)
    start = np.array([trap.position.at(0.0) for trap in scene.traps])
    data.start = wp.array(start, dtype=wp.vec3d, device=device)
    data.hand_of = wp.array(hand_of, dtype=wp.int32, device=device)
    data.carried = wp.array(np.array(list(carried.items())), dtype=wp.vec2i, device=device)
    data.place = wp.array(model.start_position(), dtype=wp.vec3, device=device)
    turned = (
        model.start_orientation() if model.features.rigid else np.tile([0.0, 0.0, 0.0, 1.0], (len(scene.bodies), 1))
    )
    data.turned = wp.array(turned, dtype=wp.quat, device=device)
    data.moving = wp.array(np.array(moving_obstacles(task), dtype=np.int32), dtype=wp.int32, device=device)
    return data


def moving_obstacles(task: Task) -> list[int]:
    """Indices of obstacles that move."""
    return [n for n, obstacle in enumerate(task.scene.obstacles) if obstacle.position.animated]


def moving_shapes(task: Task) -> tuple[str, ...]:
    """Shapes of obstacles that move, each once."""
    return tuple(sorted({task.scene.obstacles[n].shape for n in moving_obstacles(task)}))
