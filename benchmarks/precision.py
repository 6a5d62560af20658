"""What float32 costs, and what float64 costs.

Both precisions see the same noise, so that paths differ by rounding alone. Float32 is set beside float64, which rounds
5·10⁸ times less; the error of the time step is in both and cancels.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks import precision_scenes as scenes
from benchmarks.report import Section, command, positive
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.bench.timing import Quartiles, calls_for, elapsed, interleaved
from otwarp.device import pick_device
from otwarp.scene import Scene
from otwarp.simulation.simulation import Simulation

PRECISIONS = ("float32", "float64")
PLACES = (0.0, 1e2, 1e4, 1e6)
STIFFNESSES = (20.0, 1e3, 1e5)
MODULI = (1e3, 1e5, 1e7, 1e9)
SNAPSHOTS = 20
"""Snapshots of a trapped bead behind its variance, `APART` relaxation times from each other."""
APART = 1.0
WALK = 200
"""Steps of a bead that nothing holds."""
WORLDS = {"cpu": 1000, "cuda": 100_000}
TIMED = {"cpu": 256, "cuda": 1 << 16}
"""Worlds of the timed runs."""


@dataclass(frozen=True)
class Twins:
    """One scene in float32 and in float64, with the same noise."""

    both: tuple[Simulation, Simulation]

    @classmethod
    def of(cls, scene: Scene, device: Any, worlds: int, **more: Any) -> Twins:
        """otwarp warns where float32 is not fine enough; that is what is measured here."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            made = [Simulation(scene, worlds=worlds, device=device, seed=3, precision=p, **more) for p in PRECISIONS]
        return cls((made[0], made[1]))

    def step(self, steps: int) -> None:
        """Both."""
        for sim in self.both:
            sim.step(steps)

    def places(self, origin: Any = 0.0) -> np.ndarray:
        """(2, W, B, 3) positions from `origin` [µm]."""
        return np.stack([sim.state.position.numpy().astype(float) - origin for sim in self.both])


def rms(values: np.ndarray) -> float:
    """Root of the mean square."""
    return float(np.sqrt((values**2).mean()))


def in_a_trap(place: float, stiffness: float, device: Any, worlds: int) -> dict[str, float]:
    """A trapped bead at (place, place, place): moments over all worlds and `SNAPSHOTS` times, in units of σ."""
    scene = scenes.trapped(place, stiffness)
    twins = Twins.of(scene, device, worlds)
    spread = math.sqrt(scenes.ENERGY / stiffness)
    drag = 6.0 * math.pi * scene.medium.viscosity * scenes.RADIUS
    relaxation = drag / stiffness / twins.both[0].time_step
    twins.step(math.ceil(6.0 * relaxation))
    x = []
    for _ in range(SNAPSHOTS):
        twins.step(math.ceil(APART * relaxation))
        x.append(twins.places(place)[:, :, 0] / spread)
    x = np.stack(x, axis=1)
    square, mean = (x**2).mean(axis=(1, 2, 3)), x.mean(axis=(1, 2, 3))
    return {
        "place": place,
        "stiffness": stiffness,
        "spacing": float(np.spacing(np.float32(place))),
        "spread": spread,
        "step": spread * math.sqrt(2.0 / relaxation),
        "variance": float(square[0] / square[1] - 1.0),
        "mean": float(mean[0] - mean[1]),
        "path": rms(x[0] - x[1]),
    }


def adrift(place: float, device: Any, worlds: int) -> dict[str, float]:
    """A bead that nothing holds: diffusion and drift of float32 over those of float64, less 1."""
    out = {}
    for name, speed, brownian, count in (("noisy", 100.0, True, worlds), ("still", 1.0, False, 1)):
        twins = Twins.of(scenes.drifting(place, speed=speed, brownian=brownian), device, count)
        twins.step(WALK)
        x = twins.places(place)[:, :, 0]
        drift = x[:, :, 0].mean(axis=1)
        out[f"{name} drift"] = float(drift[0] / drift[1] - 1.0)
        if brownian:
            spread = x[:, :, 1:].var(axis=(1, 2))
            out["diffusion"] = float(spread[0] / spread[1] - 1.0)
    return out


def long_runs(device: Any, worlds: int, longest: int) -> list[dict[str, float]]:
    """How far paths of the same noise part, after 10³, 10⁴, … steps."""
    beads = [Twins.of(scene, device, worlds) for scene in (scenes.trapped(10.0), scenes.free())]
    robot = Twins.of(scenes.robot(), device, worlds)
    spread = math.sqrt(scenes.ENERGY / scenes.USUAL)
    rows, taken = [], 0
    for steps in (10**n for n in range(3, 12) if 10**n <= longest):
        for twins in (*beads, robot):
            twins.step(steps - taken)
        taken = steps
        held, loose, moved = (twins.places() for twins in (*beads, robot))
        turns = [sim.state.orientation.numpy().astype(float) for sim in robot.both]
        rows.append(
            {
                "steps": steps,
                "trapped": rms(held[0] - held[1]) / spread,
                "free": rms(loose[0] - loose[1]),
                "walked": rms(loose[1]),
                "robot": rms(moved[0] - moved[1]),
                "turn": 4.0 * rms(turns[0] - turns[1]),  # an angle is twice the length of four components
                **{f"norm {p}": float(np.abs(np.linalg.norm(q, axis=-1) - 1.0).max())
                   for p, q in zip(PRECISIONS, turns, strict=True)},
            }
        )  # fmt: skip
    return rows


def contact(modulus: float, device: Any) -> dict[str, float]:
    """Two cells at rest under a load: overlap, and the errors of overlap and force in float32."""
    twins = Twins.of(scenes.pressed(modulus), device, 1)
    twins.step(5000)
    x = twins.places()[:, 0]
    overlap = 3.5 - np.linalg.norm(x[:, 0] - x[:, 1], axis=1)
    load = np.array([sim.readout.contact_load.numpy().astype(float)[0, 0] for sim in twins.both])
    return {
        "modulus": modulus,
        "overlap": float(overlap[1]),
        "load": float(load[1]),
        "overlap error": float(overlap[0] - overlap[1]),
        "load error": float(load[0] / load[1] - 1.0),
    }


TIMES = {
    "bead, harmonic trap": lambda: scenes.trapped(10.0),
    "bead, tabulated trap": scenes.tabulated,
    "robot of 5 spheres, 3 traps": scenes.robot,
    "two cells pressed together": lambda: scenes.pressed(1e3, brownian=True),
}


def run_times(
    timed: Sequence[str], device: Any, *, worlds: int, rounds: int, seconds: float
) -> dict[str, dict[str, Any]]:
    """ns per body and step of some of `TIMES` in both precisions, one thread, in turns."""
    benches = {}
    for name in timed:
        twins = Twins.of(TIMES[name](), device, worlds, threads=1)
        samples = []
        for sim in twins.both:
            steps = calls_for(sim.step, sim.model.device, seconds)
            bodies = worlds * sim.model.features.bodies

            def sample(sim: Simulation = sim, steps: int = steps, bodies: int = bodies) -> float:
                taken = elapsed(lambda: sim.step(steps), sim.model.device)
                return 1e9 * taken.on(sim.model.device) / (steps * bodies)

            samples.append(sample)
        benches[name] = (samples[1], samples[0])
    found = interleaved(benches, rounds)
    return {
        name: {"float64": Quartiles.of(p.first), "float32": Quartiles.of(p.second), "ratio": p.ratio()}
        for name, p in found.items()
    }


def measure(
    device: str = "cpu",
    *,
    rounds: int = 9,
    seconds: float = 0.05,
    worlds: int | None = None,
    longest: int = 1_000_000,
    places: Sequence[float] = PLACES,
    stiffnesses: Sequence[float] = STIFFNESSES,
    moduli: Sequence[float] = MODULI,
    timed: Sequence[str] = tuple(TIMES),
) -> Section:
    """All tables; `worlds` behind each average, `longest` run in steps, `seconds` per sample of the scenes `timed`."""
    place = pick_device(device)
    kind = "cpu" if place.is_cpu else "cuda"
    machine = Machine.look(place)
    many = worlds or WORLDS[kind]
    far = [{**in_a_trap(x, scenes.USUAL, place, many), **adrift(x, place, many)} for x in places]
    stiff = [in_a_trap(x, k, place, many) for x in (10.0, 100.0) for k in stiffnesses]
    touching = [contact(e, place) for e in moduli]
    runs = long_runs(place, min(many, 16), longest)
    times = run_times(timed, place, worlds=min(many, TIMED[kind]), rounds=rounds, seconds=seconds)
    tables = [_far_table(far), _stiff_table(stiff), _contact_table(touching), _long_table(runs), _time_table(times)]
    plain = {name: {key: vars(value) for key, value in row.items()} for name, row in times.items()}
    data = {"far": far, "stiff": stiff, "contact": touching, "long": runs, "times": plain}
    return Section(name="precision", kind=kind, machine=machine, tables=tables, data=data)


def _percent(share: float) -> str:
    if abs(share) < 5e-6:
        return "0"
    return f"{100.0 * share:+{'.0f' if abs(share) > 0.0995 else '.1g'}} %"


def _spacing(row: dict[str, float]) -> str:
    """At the origin what is finer than any move."""
    return f"{1e3 * row['spacing']:.2g}" if row["place"] else "< 1e-6"


STATISTICS = (
    "*Path* is the root mean square distance between both precisions at the same time. Standard errors of a difference "
    f"follow from it: of a mean path/√n, of a variance 2·path/√n, n = 3·{SNAPSHOTS} per world."
)


def _far_table(rows: list[dict[str, float]]) -> Table:
    return Table(
        title="Float32 against float64, far from the origin",
        head=("distance along each axis [µm]", "spacing of float32 [nm]", "variance in a trap", "mean in a trap [σ]",
              "path in a trap [σ]", "diffusion", "drift of 100 µm/s", "drift of 1 µm/s without noise"),
        rows=[
            (f"{r['place']:g}", _spacing(r), _percent(r["variance"]), f"{r['mean']:+.1g}",
             f"{r['path']:.1g}", _percent(r["diffusion"]), _percent(r["noisy drift"]), _percent(r["still drift"]))
            for r in rows
        ],
        note=f"A bead of 1 µm; the trap has {scenes.USUAL:g} pN/µm (σ = {1e3 * rows[0]['spread']:.3g} nm, thermal "
        f"steps of {1e3 * rows[0]['step']:.2g} nm). Without a trap the time step is 100 µs: thermal steps of 7 nm, "
        f"drift of 10 and of 0.1 nm per step. {STATISTICS}",
    )  # fmt: skip


def _stiff_table(rows: list[dict[str, float]]) -> Table:
    return Table(
        title="Float32 against float64, stiff traps",
        head=("stiffness [pN/µm]", "distance along each axis [µm]", "σ [nm]", "spacing of float32 [nm]", "variance",
              "mean [σ]", "path [σ]"),
        rows=[
            (f"{r['stiffness']:g}", f"{r['place']:g}", f"{1e3 * r['spread']:.2g}", f"{1e3 * r['spacing']:.2g}",
             _percent(r["variance"]), f"{r['mean']:+.1g}", f"{r['path']:.1g}")
            for r in rows
        ],
        note="The same columns as above, with the same standard errors.",
    )  # fmt: skip


def _contact_table(rows: list[dict[str, float]]) -> Table:
    return Table(
        title="Float32 against float64, two cells pressed together, at rest 10 µm from the origin",
        head=("Young's modulus [Pa]", "force [pN]", "overlap [nm]", "error of the overlap [nm]", "error of the force"),
        rows=[
            (f"{r['modulus']:.0e}", f"{r['load']:.3g}", f"{1e3 * r['overlap']:.3g}",
             f"{1e3 * r['overlap error']:+.1g}", _percent(r["load error"]))
            for r in rows
        ],
    )  # fmt: skip


def _long_table(rows: list[dict[str, float]]) -> Table:
    return Table(
        title="How far paths of the same noise part in long runs",
        head=("steps", "trapped bead [σ]", "free bead [nm]", "which has gone [µm]", "trapped robot [nm]",
              "its orientation [rad]", "error of its quaternion's norm", "the same in float64"),
        rows=[
            (f"{r['steps']:.0e}", f"{r['trapped']:.1g}", f"{1e3 * r['free']:.2g}", f"{r['walked']:.2g}",
             f"{1e3 * r['robot']:.1g}", f"{r['turn']:.1g}", f"{r['norm float32']:.1g}", f"{r['norm float64']:.1g}")
            for r in rows
        ],
        note="Root mean squares along an axis. The bead's trap is 10 µm from the origin along each axis.",
    )  # fmt: skip


def _time_table(times: dict[str, dict[str, Any]]) -> Table:
    return Table(
        title="Run time [ns per body-step], one thread",
        head=("scene", "float32", "float64", "float64 over float32"),
        rows=[(name, *(t[key].text(".3g") for key in ("float32", "float64", "ratio"))) for name, t in times.items()],
    )


if __name__ == "__main__":
    command(
        measure,
        "What float32 costs, and what float64 costs.",
        rounds=9,
        worlds={"type": positive, "help": "worlds behind each average (default: 1000, CUDA 100000)"},
        longest={"type": positive, "default": 1_000_000, "help": "steps of the longest run (default: 1e6)"},
    )
