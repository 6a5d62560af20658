"""A recorded run, gone on with from one of its frames: how bodies move while the shutter of a camera is open."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.record.run import MOST_STEPS
from otwarp.scene import Scene, Track
from otwarp.scene.transforms import rotate
from otwarp.simulation.simulation import Simulation

BLUR_SAMPLES = 16
"""Moments of an exposure that are averaged."""

AT_ONCE = 500
"""Steps between two words of progress: of ten thousand cells on a CPU they take seconds."""

METHOD = ("precision", "integrator", "noise")
"""What a recording says of how its run was stepped, as `Simulation` has it."""


def exposed(
    sim: Simulation, start: float, exposure: float, progress: Callable[[int, int], None] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """(e, B, 3) origins of the bodies' prims [µm] and (e, B, 4) orientations of world 0 during an exposure.

    Args:
        sim: At most at its start.
        start: [s].
        exposure: [s]; 0 for a moment.
        progress: Called with steps taken and steps in all.

    Raises:
        InputError: More steps than a run may have.
    """
    first = sim.state.step
    total = (start + exposure - sim.time) / sim.time_step
    if not total <= MOST_STEPS:
        raise InputError(f"time is {start:g} s at a time step of {sim.time_step:.6g} s, {total:.3g} steps; "
                         f"allowed: up to {MOST_STEPS:g} steps")  # fmt: skip
    places, turns = [], []
    for n in range(BLUR_SAMPLES if exposure > 0.0 else 1):
        steps = round((start + exposure * n / (BLUR_SAMPLES - 1) - sim.time) / sim.time_step)
        while steps > 0:
            sim.step(min(steps, AT_ONCE))
            steps -= AT_ONCE
            if progress is not None:
                progress(sim.state.step - first, round(total))
        position, orientation = sim.prim_poses()
        places.append(np.array(position[0], dtype=float))
        turns.append(np.array(orientation[0], dtype=float))
    return np.array(places), np.array(turns)


class Replay:
    """The simulation of one world of a recorded run, put where a frame has it.

    Noise is a function of seed, world and step, and so the way from a frame to the next is that of the run itself, up
    to the rounding of what was recorded. Parameters that differed from world to world are not in a recording, traps
    excepted: here they are the scene's.

    Args:
        scene: Of the run.
        data: Its `run.nc`, open.
        world: Which of the recorded ones.
        device: Of the simulation.

    Raises:
        InputError: The recording does not say how the run was stepped.
    """

    def __init__(self, scene: Scene, data: Any, world: int, *, device: str | None = None):
        told = set(data.ncattrs())
        absent = [name for name in ("seed", "time_step", "total_worlds", *METHOD) if name not in told]
        if absent:
            raise InputError(f"{data.filepath()}: says nothing of {', '.join(absent)}, by which bodies move during an "
                             "exposure; allowed: a run that was recorded with them, or no exposure")  # fmt: skip
        number, worlds = int(data["world"][world]), int(data.total_worlds)
        self.sim = Simulation(
            _as_recorded(scene, data, world), worlds=worlds, part=None if worlds == 1 else (number, number + 1),
            seed=int(data.seed), time_step=float(data.time_step), device=device, allow_large_step=True,
            fast_math=bool(getattr(data, "fast_math", 0)), crossings=bool(getattr(data, "crossings", 1)),
            **{name: getattr(data, name) for name in METHOD},
        )  # fmt: skip

    def during(
        self,
        position: np.ndarray,
        orientation: np.ndarray,
        step: int,
        exposure: float,
        progress: Callable[[int, int], None] | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Poses of all bodies from a frame on, as of `exposed`.

        Args:
            position: (B, 3) origins of the bodies' prims in that frame [µm].
            orientation: (B, 4).
            step: Of the run at that frame.
            exposure: [s].
            progress: As of `exposed`.
        """
        sim = self.sim
        sim.state.step, sim.state.time = step, step * sim.time_step
        if sim.model.features.episodes:  # worlds of a part have clocks of their own
            sim.arrays()["episodes.step"].fill_(step)
        turns = orientation if sim.model.features.rigid else None
        sim.set_state(position=position + rotate(orientation, sim.model.reference), orientation=turns)
        return exposed(sim, sim.time, exposure, progress)


def _as_recorded(scene: Scene, data: Any, world: int) -> Scene:
    """The scene with its traps as they were in a world."""
    time, traps = np.asarray(data["time"][:], dtype=float), []
    for n, trap in enumerate(scene.traps):
        place = Track(times=time, values=np.asarray(data["trap_position"][:, world, n], dtype=float))
        power = Track(times=time, values=np.asarray(data["trap_power"][:, world, n], dtype=float)[:, None])
        traps.append(dataclasses.replace(trap, position=place, power=power, speed_limit=float("inf")))
    # it has been judged when it was run
    return dataclasses.replace(scene, traps=tuple(traps), judged=True)
