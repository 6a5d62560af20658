"""A tracker on simulated truth: errors of measurements and track, NEES and NIS, with late and lost frames; its time."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from benchmarks.report import Section, command
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.device import pick_device
from otwarp.scene import Scene
from otwarp.scene.transforms import rotation_matrix
from otwarp.simulation import Simulation
from otwarp.vision.tracking.commands import Commands
from otwarp.vision.tracking.consistency import Consistency, consistency, error_correlation, squared_error
from otwarp.vision.tracking.measurement import Measurement, tilt_and_azimuth
from otwarp.vision.tracking.mobile import MobileBody
from otwarp.vision.tracking.rotations import difference, exponential
from otwarp.vision.tracking.shape import Shape
from otwarp.vision.tracking.tracker import Tracker

SCENES = {"single_bead": 0.01, "two_trap_dimer": 0.01, "strategy_a": 0.02}
"""Scene → time between frames [s]."""

CASES = ((0.0, 0.0), (0.02, 0.0), (0.05, 0.0), (0.0, 0.1), (0.0, 0.3), (0.05, 0.3))
"""By how much measurements are late [s], and the share of frames that is lost."""

NOISE = np.array([0.03, 0.03, 0.06, 0.03, 0.03])
"""Standard deviations of measurements: x, y, z [µm], tilt and azimuth [rad]."""

WORLDS, FRAMES, SETTLE = 4, 150, 10


class Truth:
    """Worlds of one scene, frame by frame, and a measurement of each."""

    def __init__(self, name: str, device: str, seed: int = 1):
        self.scene = Scene.load(f"scenes/{name}.usda")
        body = self.scene.bodies[0].name
        self.body = MobileBody(self.scene, body)
        self.shape = Shape.of(self.scene, body, self.body.reference)
        sim, rng = Simulation(self.scene, worlds=WORLDS, seed=seed, device=device), np.random.default_rng(seed)
        self.frames: list[tuple[float, np.ndarray, np.ndarray, list[Measurement]]] = []
        for _ in range(FRAMES):
            sim.run(SCENES[name])
            places, turns = (rows[:, 0].copy() for rows in sim.prim_poses())
            seen = [self.look(rng, sim.time, p, q) for p, q in zip(places, turns, strict=True)]
            self.frames.append((sim.time, places, turns, seen))

    def look(self, rng: np.random.Generator, when: float, place: np.ndarray, turn: np.ndarray) -> Measurement:
        """A measurement with noise drawn for it."""
        off, covariance = NOISE * rng.standard_normal(5), np.diag(NOISE**2)
        frame = rotation_matrix(turn)
        centre = place + frame @ (self.shape.arm - self.shape.origin) + off[:3]
        if not np.any(self.shape.axis):
            return Measurement(time=when, position=centre, covariance=covariance[:3, :3])
        axis = frame @ self.shape.axis
        lean = rotation_matrix(exponential(tilt_and_azimuth(axis, np.array([0.0, 0.0, 1.0])).T @ off[3:]))
        return Measurement(time=when, position=centre, axis=lean @ axis, covariance=covariance)


def followed(truth: Truth, delay: float, drop: float) -> dict[str, Any]:
    """Errors and consistency of tracks in all worlds, and the time of an update and of a prediction [s]."""
    rng, shape = np.random.default_rng(5), truth.shape
    nees, white, off, nis, spent = [], [], [], [], []
    degrees = 3
    for world in range(WORLDS):
        tracker = Tracker(truth.body, shape, Commands.of_scene(truth.scene))
        waiting: list[Measurement] = []
        rows: list[list[Any]] = [[], [], []]
        for n, (when, places, turns, seen) in enumerate(truth.frames):
            if n == 0 or rng.random() >= drop:
                waiting.append(seen[world])
            # the first is there at once, so that there is a track
            while waiting and (waiting[0].time + delay <= when + 1e-9 or tracker.time is None):
                one = waiting.pop(0)
                start = time.perf_counter()
                update = tracker.add(one)
                spent.append(time.perf_counter() - start)
                if n >= SETTLE:
                    nis.append(update.nis)
            pose = tracker.predict(when)
            frame = rotation_matrix(turns[world])
            value, degrees = squared_error(pose.belief, shape, places[world] - frame @ shape.origin, turns[world])
            nearest = shape.nearest(turns[world], pose.orientation)
            error = np.concatenate(
                [places[world] - frame @ shape.origin - pose.belief.position, difference(nearest, pose.orientation)]
            )
            visible = shape.visible(pose.orientation)
            spread = np.linalg.cholesky(visible @ pose.belief.covariance @ visible.T)
            entries = value, np.linalg.solve(spread, visible @ error), pose.position - places[world]
            for row, entry in zip(rows, entries, strict=True):
                row.append(entry)
        for kept, row in zip((nees, white, off), rows, strict=True):
            kept.append(row[SETTLE:])
    correlation = error_correlation(np.array(white))
    spread = np.sqrt(np.mean(np.square(off), axis=(0, 1)))
    late = _prediction(tracker, truth.frames[-1][0])
    return {
        "filtered": spread, "nees": consistency(nees, degrees, correlation=correlation),
        "nis": consistency([v for v in nis if np.isfinite(v)], degrees), "update": float(np.median(spent)),
        "prediction": late,
    }  # fmt: skip


def _prediction(tracker: Tracker, last: float) -> float:
    """Median time of a prediction, a millisecond after the other [s]."""
    spent = []
    for n in range(1, 101):
        start = time.perf_counter()
        tracker.predict(last + 0.001 * n)
        spent.append(time.perf_counter() - start)
    return float(np.median(spent))


def _nm(values: np.ndarray) -> str:
    return " / ".join(f"{1e3 * v:.0f}" for v in values)


def _said(found: Consistency) -> str:
    return f"{found.mean:.2f} ± {found.error:.2f}"


def measure(device: str = "cpu", *, rounds: int = 1) -> Section:
    """All scenes, delays and shares of lost frames; seeds are fixed, so that `rounds` changes nothing."""
    place = pick_device(device)
    rows: list[tuple[str, ...]] = []
    data: dict[str, Any] = {}
    for name, interval in SCENES.items():
        truth = Truth(name, device)
        for delay, drop in CASES:
            found = followed(truth, delay, drop)
            rows.append((
                name, f"{1e3 * interval:g}", f"{1e3 * delay:g}", f"{100 * drop:g}", _nm(found["filtered"]),
                _said(found["nees"]), _said(found["nis"]), f"{1e6 * found['update']:.0f}",
                f"{1e6 * found['prediction']:.0f}",
            ))  # fmt: skip
            data[f"{name}, {delay:g}, {drop:g}"] = {
                "filtered": found["filtered"].tolist(), "nees": found["nees"].mean, "nis": found["nis"].mean,
                "update": found["update"], "prediction": found["prediction"],
            }  # fmt: skip
    head = ("scene", "frames every [ms]", "late by [ms]", "lost [%]", "track x / y / z [nm]", "NEES", "NIS",
            "update [µs]", "prediction [µs]")  # fmt: skip
    title = f"Root mean square error of tracks from measurements of {_nm(NOISE[:3])} nm"
    note = (
        f"{WORLDS} worlds × {FRAMES} frames, errors at the time of each frame by what had come in by then; angles "
        "are measured to 1.7°. NEES and NIS per degree of freedom, ± the standard error that χ² lets expect."
    )
    kind = "cpu" if place.is_cpu else "cuda"
    table = Table(title=title, head=head, rows=rows, note=note)
    return Section(name="vision_tracking", kind=kind, machine=Machine.look(place), tables=[table], data=data)


if __name__ == "__main__":
    command(measure, "Errors, consistency and time of a tracker.", rounds=1)
