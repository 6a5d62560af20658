"""Recorded runs for tests: written by the recorder, from frames that nobody had to simulate."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import otwarp as ot
from otwarp.record import Recorder
from otwarp.simulation.frame import Frame

SCENE = Path(__file__).resolve().parents[2] / "scenes" / "teleop_small.usda"
RATE = 60.0
SPEED = 3.0
"""Of all bodies and traps along x [µm/s]."""
PEAK, PEAK_AT = 12.5, 77
"""Contact load of the cell at one frame [pN]; zero at all others."""
STEP = 1e-3


def frames(scene: ot.Scene, count: int, speed: float = SPEED) -> list[Frame]:
    """Bodies and traps that go along x."""
    place = np.array([b.position for b in scene.bodies])[None]
    turn = np.array([b.orientation for b in scene.bodies])[None]
    focus = np.array([t.position.at(0.0) for t in scene.traps])[None]
    made = []
    for n in range(count):
        time = n / RATE
        way = np.array([speed * time, 0.0, 0.0])
        load = np.zeros((1, len(scene.bodies)))
        if n == PEAK_AT:
            load[0, -1] = PEAK
        made.append(
            Frame(
                step=round(time / STEP),
                time=time,
                position=place + way,
                orientation=turn,
                trap_position=focus + way,
                trap_power=np.full((1, len(scene.traps)), 5.0),
                trap_force=np.full((1, len(scene.traps), 3), 1.0),
                trap_distance=np.full((1, len(scene.traps)), 0.1 + 0.01 * n / count),
                escape_time=np.full((1, len(scene.traps)), np.nan),
                contact_force=np.zeros((1, len(scene.bodies), 3)),
                contact_load=load,
            )
        )
    return made


def recorded(folder: Path, count: int = 120, speed: float = SPEED) -> Path:
    """The folder of a run of so many frames."""
    scene = ot.Scene.load(SCENE)
    held = [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)]
    with Recorder(scene, folder, frames_per_second=RATE, held=held, time_step=STEP, figure=False) as recorder:
        for frame in frames(scene, count, speed):
            recorder.write(frame)
    return folder
