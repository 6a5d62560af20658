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

from otwarp.bench.findings import Findings
from otwarp.bench.machine import Machine
from otwarp.bench.speed.peers import numpy_bead
from otwarp.bench.terms.scenes import COMPARISONS, PLACE, RADIUS, SCENES, THERMAL, TOGETHER, Comparison, alone, trap
from otwarp.bench.timing import Pairs, Quartiles, calls_for, elapsed, interleaved
from otwarp.bench.typed import check_names
from otwarp.device import pick_device
from otwarp.laws import TrapLaw
from otwarp.scene import Scene
from otwarp.simulation.info import device_bytes
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
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
class TimedScene:
    """A scene in many worlds, ready to be timed: `sample` returns ns per body-step."""

    sim: Simulation
    bodies: int
    steps: int

    @classmethod
    def of(cls, scene: Scene, device: wp.Device, *, bodies: int, seconds: float) -> TimedScene:
        """As many worlds as hold `bodies`, and as many steps as take `seconds`."""
        worlds = max(1, bodies // len(scene.bodies))
        sim = Simulation(scene, worlds=worlds, device=device, time_step=TIME_STEP, allow_large_step=True, threads=1)
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
        options = StepOptions(time_step=TIME_STEP, allow_large_step=True)
        model = Model.build(scene, worlds=worlds, device=device, options=options)
        sizes.append(device_bytes(model, State.start(model), Control.start(model), Readout.empty(model)))
    return sizes[1] - sizes[0]


class TimedScenes:
    """The scenes by name, each made when first asked for."""

    def __init__(self, device: wp.Device, *, bodies: int, seconds: float):
        self.device, self.bodies, self.seconds = device, bodies, seconds
        self.made: dict[str, TimedScene] = {}

    def __getitem__(self, name: str) -> TimedScene:
        if name not in self.made:
            self.made[name] = TimedScene.of(SCENES[name](), self.device, bodies=self.bodies, seconds=self.seconds)
        return self.made[name]


def take_samples(scenes: TimedScenes, comparisons: Sequence[Comparison], rounds: int) -> dict[str, Pairs]:
    """Samples of all comparisons, and of the bare bead beside every scene of `TOGETHER` whose parts are among them.

    All are taken in the same rounds, so that a sum of costs and what it is set beside saw the same machine.
    """
    measured = {case.with_ for case in comparisons}
    pairs = {case.term: (scenes[case.without].sample, scenes[case.with_].sample) for case in comparisons}
    pairs |= {
        label: (scenes["bead"].sample, scenes[name].sample)
        for label, (name, parts) in TOGETHER.items()
        if set(parts) <= measured
    }
    return interleaved(pairs, rounds)


def compare(
    scenes: TimedScenes, comparisons: Sequence[Comparison], samples: Mapping[str, Pairs]
) -> dict[str, dict[str, Any]]:
    """Cost of each term: with it minus without it, pair by pair."""
    out = {}
    for case in comparisons:
        both = [scenes[case.without].sim, scenes[case.with_].sim]
        out[case.term] = {
            "off": Quartiles.of(samples[case.term].first),
            "on": Quartiles.of(samples[case.term].second),
            "cost": samples[case.term].difference(),
            "drivers": [sim.model.features.driver for sim in both],
            "bytes_per_world": [world_bytes(sim.scene, scenes.device) for sim in both],
            "touching": scenes[case.with_].touching(),
        }
    return out


def together(
    scenes: TimedScenes, comparisons: Sequence[Comparison], samples: Mapping[str, Pairs]
) -> dict[str, dict[str, Any]]:
    """Several terms at once beside the sum of what each costs alone; whole steps where there is no such sum."""
    cost_of = {case.with_: samples[case.term].difference().median for case in comparisons}
    return {
        label: {
            "step": Quartiles.of(samples[label].second),
            "cost": samples[label].difference(),
            "sum_of_parts": sum(cost_of[part] for part in parts) if parts else None,
            "bytes_per_world": world_bytes(scenes[name].sim.scene, scenes.device),
        }
        for label, (name, parts) in TOGETHER.items()
        if label in samples
    }


def measure_readout(scenes: TimedScenes, names: Sequence[str], rounds: int) -> dict[str, dict[str, Any]]:
    """Trap readout on demand [ns per body]: forces per trap, sphere and hand, and distances."""
    out = {}
    for name in names:
        timed = scenes[name]
        sim, device = timed.sim, scenes.device

        def measure(times: int, sim: Simulation = sim) -> None:
            for _ in range(times):
                sim.measure()

        times = calls_for(measure, device, scenes.seconds)
        taken = [elapsed(partial(measure, times), device).on(device) for _ in range(rounds)]
        out[name] = {
            "traps": len(sim.scene.traps),
            "cost": Quartiles.of([1e9 * t / (times * timed.bodies) for t in taken]),
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
    law = scene.traps[0].radial
    assert law is not None
    unit = BOLTZMANN * scene.medium.temperature / law.stiffness
    ours = TimedScene.of(scene, device, bodies=beads, seconds=seconds)
    theirs = numpy_bead.Peer(beads, relaxation=RELAXATION, kick=math.sqrt(2.0 * unit * RELAXATION), seed=1)
    host = wp.get_device("cpu")
    steps = calls_for(theirs.step, host, seconds)

    def numpy_rate() -> float:
        return beads * steps / elapsed(lambda: theirs.step(steps), host).cpu

    rates = interleaved({"case a": (lambda: 1e9 / ours.sample(), numpy_rate)}, rounds)["case a"]
    variances = np.zeros(2)
    for _ in range(SNAPSHOTS):
        # positions 5 relaxation times apart are independent, and have forgotten the start at the trap's centre
        ours.sim.step(math.ceil(5.0 / RELAXATION))
        theirs.step(math.ceil(5.0 / RELAXATION))
        own = ((ours.sim.state.position.numpy() - np.array(PLACE)) ** 2).mean()
        variances += np.array([own, theirs.variance()]) / unit / SNAPSHOTS
    otwarp, numpy = variances.tolist()
    return {
        "beads": beads,
        "otwarp": Quartiles.of(rates.first),
        "numpy": Quartiles.of(rates.second),
        "ratio": rates.ratio(),
        "variance": {"otwarp": otwarp, "numpy": numpy, "theory": 1.0 / (1.0 - 0.5 * RELAXATION)},
    }


def plain(found: Any) -> Any:
    """The same with every `Quartiles` as plain numbers."""
    if isinstance(found, Quartiles):
        return vars(found)
    return {name: plain(value) for name, value in found.items()} if isinstance(found, dict) else found


@dataclass(frozen=True, kw_only=True)
class TermsBench(Findings):
    """What the terms cost on one device.

    Attributes:
        bodies: In all worlds together.
        terms: By term, see `compare`.
        together: By label, see `together`.
        readout: By scene, see `measure_readout`.
        numpy: See `beside_numpy`.
    """

    bodies: int
    terms: dict[str, dict[str, Any]]
    together: dict[str, dict[str, Any]]
    readout: dict[str, dict[str, Any]]
    numpy: dict[str, Any]

    def data(self) -> dict[str, Any]:
        """All numbers, as plain data."""
        return {name: plain(getattr(self, name)) for name in ("bodies", "terms", "together", "readout", "numpy")}

    def json(self) -> dict[str, Any]:
        """Plain data, under the name of the benchmark."""
        return {"terms": {"device": self.kind, "machine": self.machine, **self.data()}}


def bench_terms(
    device: str | None = None,
    *,
    names: Sequence[str] = (),
    comparisons: Sequence[Comparison] = COMPARISONS,
    rounds: int = 9,
    seconds: float = 0.02,
    bodies: int | None = None,
    beads: int | None = None,
) -> TermsBench:
    """Measure the terms.

    Args:
        device: `cpu`, `cuda:0`, … or None for the best available.
        names: Terms among the comparisons, none for all.
        comparisons: Pairs of scenes that differ by a term.
        rounds: Pairs of samples of each.
        seconds: Length of a sample.
        bodies: In all worlds together; None for `BODIES`.
        beads: Beside NumPy; None for `BEADS`.

    Raises:
        InputError: A name that no comparison has.
    """
    known = {case.term: case for case in comparisons}
    check_names("--term", names, known)
    comparisons = [known[name] for name in names] or comparisons
    place = pick_device(device)
    machine = Machine.look(place)
    kind = machine.kind
    scenes = TimedScenes(place, bodies=bodies or BODIES[kind], seconds=seconds)
    samples = take_samples(scenes, comparisons, rounds)
    return TermsBench(
        **machine.about(),
        bodies=scenes.bodies,
        terms=compare(scenes, comparisons, samples),
        together=together(scenes, comparisons, samples),
        readout=measure_readout(scenes, ("harmonic", "robot, traps"), rounds),
        numpy=beside_numpy(place, beads=beads or BEADS[kind], rounds=rounds, seconds=5.0 * seconds),
    )
