"""What each term of the step costs, on and off, alone and together; and a bead beside a NumPy loop.

Every cost is the difference of two scenes measured in turns, so that what both share, and slow drifts of the machine,
cancel. Many worlds, one thread.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import warp as wp

from benchmarks.machine import Machine
from benchmarks.numpy_bead import NumpyBeads
from benchmarks.report import Section, Table, command, options, positive, save_json
from benchmarks.term_scenes import COMPARISONS, PLACE, RADIUS, SCENES, THERMAL, TOGETHER, Comparison, alone, trap
from benchmarks.timing import Pairs, Spread, calls_for, elapsed, interleaved
from otwarp.device import pick_device
from otwarp.laws import TrapLaw
from otwarp.scene import Scene
from otwarp.simulation.info import device_bytes
from otwarp.simulation.model import Model
from otwarp.simulation.simulation import Simulation
from otwarp.simulation.state import Control, Readout, State
from otwarp.units import BOLTZMANN

TIME_STEP = 1e-4
BODIES = {"cpu": 4096, "cuda": 1 << 18}
"""Bodies in all worlds together, by kind of device."""
BEADS = {"cpu": 10_000, "cuda": 1 << 20}
"""Beads of the comparison with NumPy."""
RELAXATION = 0.05
"""k·dt/γ of that comparison: an Euler–Maruyama variance 2.6 % above k_B T/k."""
SNAPSHOTS = 5
"""Independent snapshots behind its variances."""


@dataclass
class Bench:
    """A scene in many worlds, ready to be timed: `sample` returns ns per body-step."""

    sim: Simulation
    bodies: int
    steps: int

    @classmethod
    def of(cls, scene: Scene, device: wp.Device, *, bodies: int, seconds: float) -> Bench:
        """As many worlds as hold `bodies`, and as many steps as take `seconds`."""
        worlds = max(1, bodies // len(scene.bodies))
        sim = Simulation(scene, worlds=worlds, device=device, time_step=TIME_STEP, threads=1)
        steps = calls_for(sim.step, device, seconds)
        return cls(sim, worlds * len(scene.bodies), steps)

    def sample(self) -> float:
        """One measurement [ns per body-step]."""
        taken = elapsed(lambda: self.sim.step(self.steps), self.sim.model.device)
        return 1e9 * taken.on(self.sim.model.device) / (self.steps * self.bodies)

    def touching(self) -> float:
        """Share of the bodies that feel a contact force."""
        load = self.sim.readout.contact_load.numpy()
        return float((load > 0.0).mean()) if load.size else 0.0


def world_bytes(scene: Scene, device: wp.Device) -> int:
    """Device memory that one more world takes [B]."""
    sizes = []
    for worlds in (1, 2):
        model = Model.build(scene, worlds=worlds, device=device, time_step=TIME_STEP)
        sizes.append(device_bytes(model, State.start(model), Control.start(model), Readout.empty(model)))
    return sizes[1] - sizes[0]


class Benches:
    """The scenes by name, each made when first asked for."""

    def __init__(self, device: wp.Device, *, bodies: int, seconds: float):
        self.device, self.bodies, self.seconds = device, bodies, seconds
        self.made: dict[str, Bench] = {}

    def __getitem__(self, name: str) -> Bench:
        if name not in self.made:
            self.made[name] = Bench.of(SCENES[name](), self.device, bodies=self.bodies, seconds=self.seconds)
        return self.made[name]


def take_samples(benches: Benches, comparisons: Sequence[Comparison], rounds: int) -> dict[str, Pairs]:
    """Samples of all comparisons, and of the bare bead beside every scene of `TOGETHER` whose parts are among them.

    All are taken in the same rounds, so that a sum of costs and what it is set beside saw the same machine.
    """
    measured = {case.with_ for case in comparisons}
    pairs = {case.term: (benches[case.without].sample, benches[case.with_].sample) for case in comparisons}
    pairs |= {
        label: (benches["bead"].sample, benches[name].sample)
        for label, (name, parts) in TOGETHER.items()
        if set(parts) <= measured
    }
    return interleaved(pairs, rounds)


def compare(
    benches: Benches, comparisons: Sequence[Comparison], samples: Mapping[str, Pairs]
) -> dict[str, dict[str, Any]]:
    """Cost of each term: with it minus without it, pair by pair."""
    out = {}
    for case in comparisons:
        both = [benches[case.without].sim, benches[case.with_].sim]
        out[case.term] = {
            "off": Spread.of(samples[case.term].first),
            "on": Spread.of(samples[case.term].second),
            "cost": samples[case.term].difference(),
            "drivers": [sim.model.features.driver for sim in both],
            "bytes_per_world": [world_bytes(sim.scene, benches.device) for sim in both],
            "touching": benches[case.with_].touching(),
        }
    return out


def together(
    benches: Benches, comparisons: Sequence[Comparison], samples: Mapping[str, Pairs]
) -> dict[str, dict[str, Any]]:
    """Several terms at once beside the sum of what each costs alone; whole steps where there is no such sum."""
    cost_of = {case.with_: samples[case.term].difference().median for case in comparisons}
    return {
        label: {
            "step": Spread.of(samples[label].second),
            "cost": samples[label].difference(),
            "sum_of_parts": sum(cost_of[part] for part in parts) if parts else None,
            "bytes_per_world": world_bytes(benches[name].sim.scene, benches.device),
        }
        for label, (name, parts) in TOGETHER.items()
        if label in samples
    }


def measure_readout(benches: Benches, names: Sequence[str], rounds: int) -> dict[str, dict[str, Any]]:
    """Trap readout on demand [ns per body]: forces per trap, sphere and hand, and distances."""
    out = {}
    for name in names:
        bench = benches[name]
        sim, device = bench.sim, benches.device

        def measure(times: int, sim: Simulation = sim) -> None:
            for _ in range(times):
                sim.measure()

        times = calls_for(measure, device, benches.seconds)
        taken = [elapsed(partial(measure, times), device).on(device) for _ in range(rounds)]
        out[name] = {
            "traps": len(sim.scene.traps),
            "cost": Spread.of([1e9 * t / (times * bench.bodies) for t in taken]),
        }
    return out


def bead_scene() -> Scene:
    """A Brownian bead in a harmonic trap with k·dt/γ = `RELAXATION`."""
    drag = 6.0 * math.pi * alone().medium.viscosity * RADIUS
    return alone(settings=THERMAL, caught_by=trap(law=TrapLaw(stiffness=RELAXATION * drag / TIME_STEP)))


def beside_numpy(device: wp.Device, *, beads: int, rounds: int, seconds: float) -> dict[str, Any]:
    """Particle-steps per second of otwarp and of the NumPy loop on the same workload, in turns.

    Both report the variance of the position in units of k_B T/k, which the scheme makes 1/(1 − h/2).
    """
    scene = bead_scene()
    stiffness = scene.traps[0].radial.stiffness
    energy = BOLTZMANN * scene.medium.temperature
    kick = math.sqrt(2.0 * energy / stiffness * RELAXATION)
    ours = Bench.of(scene, device, bodies=beads, seconds=seconds)
    theirs = NumpyBeads(np.array(PLACE), beads, RELAXATION, kick, seed=1)
    host = wp.get_device("cpu")
    steps = calls_for(theirs.step, host, seconds)

    def numpy_rate() -> float:
        return beads * steps / elapsed(lambda: theirs.step(steps), host).cpu

    rates = interleaved({"case a": (lambda: 1e9 / ours.sample(), numpy_rate)}, rounds)["case a"]
    unit = energy / stiffness
    variances = np.zeros(2)
    for _ in range(SNAPSHOTS):
        # positions 5 relaxation times apart are independent, and have forgotten the start at the trap's centre
        ours.sim.step(math.ceil(5.0 / RELAXATION))
        theirs.step(math.ceil(5.0 / RELAXATION))
        places = (ours.sim.state.position.numpy(), theirs.position)
        variances += [((x - np.array(PLACE)) ** 2).mean() / unit / SNAPSHOTS for x in places]
    return {
        "beads": beads,
        "otwarp": Spread.of(rates.first),
        "numpy": Spread.of(rates.second),
        "ratio": rates.ratio(),
        "variance": {
            "otwarp": float(variances[0]),
            "numpy": float(variances[1]),
            "theory": 1.0 / (1.0 - 0.5 * RELAXATION),
        },
    }


def measure(
    device: str = "cpu",
    *,
    comparisons: Sequence[Comparison] = COMPARISONS,
    rounds: int = 9,
    seconds: float = 0.02,
    bodies: int | None = None,
    beads: int | None = None,
) -> Section:
    """The whole table; `seconds` per sample, `rounds` pairs of samples per term."""
    place = pick_device(device)
    kind = "cpu" if place.is_cpu else "cuda"
    machine = Machine.look(place)
    benches = Benches(place, bodies=bodies or BODIES[kind], seconds=seconds)
    samples = take_samples(benches, comparisons, rounds)
    found, sums = compare(benches, comparisons, samples), together(benches, comparisons, samples)
    readout = measure_readout(benches, ("harmonic", "robot, traps"), rounds)
    peer = beside_numpy(place, beads=beads or BEADS[kind], rounds=rounds, seconds=5.0 * seconds)
    tables = [
        _cost_table(found, benches.bodies),
        _sum_table(sums),
        _readout_table(readout),
        _peer_table(peer, "wall time on the GPU, CPU time for NumPy" if kind == "cuda" else "CPU time"),
    ]
    data = {
        "bodies": benches.bodies,
        "terms": _plain(found),
        "together": _plain(sums),
        "readout": _plain(readout),
        "numpy": _plain({"case a": peer})["case a"],
    }
    return Section(name="terms", kind=kind, machine=machine, tables=tables, data=data)


def _cost_table(found: dict[str, dict[str, Any]], bodies: int) -> Table:
    rows = []
    for term, f in found.items():
        before, after = f["drivers"]
        rows.append(
            (
                term,
                f"{f['off'].median:.3g}",
                f"{f['on'].median:.3g}",
                f["cost"].text("+.3g"),
                before if before == after else f"{before} → {after}",
                f"{f['bytes_per_world'][1] - f['bytes_per_world'][0]:+d}",
            )
        )
    return Table(
        title=f"Cost of each term [ns per body-step], {bodies} bodies, one thread",
        head=("term", "without", "with", "cost", "driver", "memory [B/world]"),
        rows=rows,
    )


def _sum_table(sums: dict[str, dict[str, Any]]) -> Table:
    rows = [
        (
            label,
            f["step"].text(".3g"),
            f["cost"].text("+.3g") if f["sum_of_parts"] is not None else "",
            f"{f['sum_of_parts']:+.3g}" if f["sum_of_parts"] is not None else "",
            str(f["bytes_per_world"]),
        )
        for label, f in sums.items()
    ]
    return Table(
        title="Together [ns per body-step]",
        head=("scene", "step", "over the bare bead", "sum of the costs alone", "memory [B/world]"),
        rows=rows,
    )


def _readout_table(found: dict[str, dict[str, Any]]) -> Table:
    labels = {"harmonic": "bead in a harmonic trap", "robot, traps": "robot of 5 spheres in 3 piecewise traps"}
    return Table(
        title="Trap readout, each time it is asked for [ns per body]",
        head=("scene", "traps", "cost"),
        rows=[(labels[name], str(f["traps"]), f["cost"].text(".3g")) for name, f in found.items()],
    )


def _peer_table(peer: dict[str, Any], clock: str) -> Table:
    variance = peer["variance"]
    return Table(
        title=f"{peer['beads']} Brownian beads in harmonic traps [million particle-steps per second of {clock}]",
        head=("code", "rate", "variance [k_B T/k]"),
        rows=[
            ("otwarp", peer["otwarp"].times(1e-6).text(), f"{variance['otwarp']:.3f}"),
            ("NumPy loop, float32", peer["numpy"].times(1e-6).text(), f"{variance['numpy']:.3f}"),
            ("ratio, pair by pair; scheme's own variance", peer["ratio"].text(), f"{variance['theory']:.3f}"),
        ],
    )


def _plain(found: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    return {
        name: {key: vars(value) if isinstance(value, Spread) else value for key, value in f.items()}
        for name, f in found.items()
    }


def main() -> None:
    """Command line."""
    parser = options("Cost of each term of the step.", rounds=9)
    parser.add_argument("--bodies", type=positive, help="bodies in all worlds together (default: 4096, CUDA 262144)")
    arguments = parser.parse_args()
    section = measure(arguments.device, rounds=arguments.rounds, bodies=arguments.bodies)
    print(section.markdown())
    if arguments.json:
        save_json(arguments.json, [section])


if __name__ == "__main__":
    command(main)
