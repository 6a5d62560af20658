"""Worlds that end and start anew, cells that come in again: what they cost; and how worlds scale over devices.

`python -m benchmarks.worlds --device cuda:0 --devices cuda:0 cuda:1` measures several devices as well.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import warp as wp

from benchmarks.report import Section, command, positive
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.bench.timing import Quartiles, calls_for, elapsed, interleaved
from otwarp.device import pick_device
from otwarp.laws import TrapLaw
from otwarp.scene import Body, Scene, Settings, Sphere, Track, Trap
from otwarp.simulation.ends import escaped
from otwarp.simulation.sharded import ShardedSimulation
from otwarp.simulation.simulation import Simulation

STEPS = 10
"""Steps of one call."""
LONG = 2000
"""Steps of one call where the steps are what is timed."""
CALLS = (1, 1_000, 100_000)
"""Worlds for which a call is timed."""
MANY = {"cpu": 4_096, "cuda": 262_144}
"""Worlds of which some have ended."""
SHARED = {"cpu": 2_048, "cuda": 1_048_576}
"""Worlds of one device where several share them."""
MOVING = (1.0, 0.5, 0.1, 0.01, 0.0)
"""Parts of the worlds that are in motion."""
CHANNELS = {"cpu": (1,), "cuda": (1, 1_024)}
"""Worlds of the channel whose cells come in again."""
FILLED = 500
"""Steps of a channel before it is timed, so that cells cross its ends."""
CHANNEL = Path(__file__).parent.parent / "scenes" / "microfluidic_channel.usda"


def bead_scene() -> Scene:
    """A bead of 1 µm in a harmonic trap of 20 pN/µm that holds it."""
    sphere = Sphere(prim="/World/Bead/S", radius=1.0, collides=False)
    law = TrapLaw(stiffness=20.0, power=20.0, cutoff=5.0)
    trap = Trap(prim="/World/Trap", position=Track.constant((0.0, 0.0, 0.0)), power=Track.constant(20.0),
                model="harmonic", radial=law)  # fmt: skip
    return Scene(bodies=(Body(prim="/World/Bead", spheres=(sphere,)),), traps=(trap,), settings=Settings())


def per_call(work: Callable[[], object], device: wp.Device, seconds: float) -> Callable[[], float]:
    """A measurement of the wall time of one call [s], of as many as take `seconds`."""

    def repeated(calls: int) -> None:
        for _ in range(calls):
            work()

    calls = calls_for(repeated, device, seconds)
    return lambda: elapsed(partial(repeated, calls), device).wall / calls


def call_costs(device: wp.Device, worlds: int, rounds: int, seconds: float) -> dict[str, Quartiles]:
    """Time of a turn [s]: `STEPS` steps; with episodes, and a reset of what has ended; the same as one graph."""
    make = partial(Simulation, bead_scene(), worlds=worlds, device=device)
    plain, ending, captured = make(), make(ends=[escaped]), make(ends=[escaped])

    def turn() -> None:
        ending.step(STEPS)
        ending.reset(ending.episodes.done)

    graph = captured.capture(STEPS, after=lambda: captured.reset(captured.episodes.done))
    plain_call = per_call(lambda: plain.step(STEPS), device, seconds)
    pairs = {
        "ends": (plain_call, per_call(turn, device, seconds)),
        "graph": (plain_call, per_call(graph, device, seconds)),
    }
    found = interleaved(pairs, rounds)
    return {
        "plain": Quartiles.of([*found["ends"].first, *found["graph"].first]),
        "ends": Quartiles.of(found["ends"].second),
        "graph": Quartiles.of(found["graph"].second),
    }


def episode_cost(device: wp.Device, worlds: int, rounds: int) -> Quartiles:
    """Time of a long segment with episodes over one without."""
    make = partial(Simulation, bead_scene(), worlds=worlds, device=device)
    pair = [lambda sim=sim: elapsed(partial(sim.step, LONG), device).on(device) for sim in (make(ends=()), make())]
    for work in pair:
        work()
    return interleaved({"": (pair[0], pair[1])}, rounds)[""].ratio()


def ended_costs(device: wp.Device, worlds: int, rounds: int) -> dict[float, Quartiles]:
    """Time of a long segment with a part of the worlds in motion over one with all of them."""
    make = partial(Simulation, bead_scene(), worlds=worlds, device=device, ends=())
    rng = np.random.default_rng(1)
    sims = {}
    for part in MOVING:
        sims[part] = make()
        still = rng.permutation(worlds)[round(part * worlds) :]
        sims[part].episodes.done.assign(np.isin(np.arange(worlds), still).astype(np.int32))
        sims[part].step(LONG)

    def timed(part: float) -> Callable[[], float]:
        return lambda: elapsed(partial(sims[part].step, LONG), device).on(device)

    found = interleaved({str(part): (timed(part), timed(1.0)) for part in MOVING}, rounds)
    return {part: found[str(part)].ratio() for part in MOVING}


def channels() -> tuple[Scene, Scene]:
    """The shipped channel, which is periodic, and as an open one whose cells come in again at an inlet."""
    scene = Scene.load(CHANNEL)
    end = 0.5 * scene.settings.period[0]
    ends = {"domain_low": (-end, 0.0, 0.0), "domain_high": (end, 0.0, 0.0)}
    inlet = {"inlet_low": (-end, -40.0, 4.0), "inlet_high": (6.0 - end, 40.0, 20.0)}
    settings = dataclasses.replace(scene.settings, period=(0.0, 0.0, 0.0), **ends, **inlet)
    return scene, dataclasses.replace(scene, settings=settings)


def inlet_cost(device: wp.Device, worlds: int, rounds: int, seconds: float) -> dict[str, Quartiles]:
    """Time of a step of the periodic channel [s], and that of the open one over it."""
    works = []
    for scene in channels():
        sim = Simulation(scene, worlds=worlds, device=device, seed=1)
        sim.step(FILLED)
        steps = calls_for(sim.step, device, seconds)
        works.append(lambda sim=sim, steps=steps: elapsed(partial(sim.step, steps), device).on(device) / steps)
    found = interleaved({"": (works[1], works[0])}, rounds)[""]
    return {"periodic": Quartiles.of(found.second), "open": found.ratio()}


def first_of(devices: Sequence[str]) -> list[Sequence[str]]:
    """The first two, four, eight … devices, and all of them."""
    counts = {2**n for n in range(1, len(devices).bit_length()) if 2**n < len(devices)} | {len(devices)}
    return [devices[:count] for count in sorted(counts)]


def shard_ratios(devices: Sequence[str], worlds: int, rounds: int) -> dict[str, Quartiles]:
    """How much faster all devices are than the first: as many worlds on each (weak), as many in all (strong)."""
    make = partial(ShardedSimulation, bead_scene())

    def timed(sim: ShardedSimulation) -> Callable[[], float]:
        places = [wp.get_device(d) for d in devices]

        def once() -> float:
            for place in places[1:]:
                wp.synchronize_device(place)
            return elapsed(lambda: sim.step(10 * LONG), places[0]).wall

        return once

    with (
        make(devices=devices[:1], worlds=worlds) as one,
        make(devices=devices, worlds=worlds * len(devices)) as weak,
        make(devices=devices, worlds=worlds) as strong,
    ):
        for sim in (one, weak, strong):
            sim.step(LONG)
        found = interleaved({"weak": (timed(one), timed(weak)), "strong": (timed(one), timed(strong))}, rounds)
    return {"weak": found["weak"].ratio().times(len(devices)), "strong": found["strong"].ratio()}


def measure(
    device: str = "cpu",
    *,
    devices: Sequence[str] = (),
    calls: Sequence[int] = CALLS,
    many: int | None = None,
    shared: int | None = None,
    channels_of: Sequence[int] | None = None,
    rounds: int = 9,
    seconds: float = 0.2,
) -> Section:
    """All tables; `devices` that share worlds beside `device` are measured if there are any."""
    place = pick_device(device)
    kind = "cpu" if place.is_cpu else "cuda"
    many, shared = many or MANY[kind], shared or SHARED[kind]
    costs = {worlds: call_costs(place, worlds, rounds, seconds) for worlds in calls}
    ended = ended_costs(place, many, rounds)
    over = episode_cost(place, many, rounds)
    wide = CHANNELS[kind] if channels_of is None else channels_of
    inlets = {worlds: inlet_cost(place, worlds, rounds, seconds) for worlds in wide}
    tables = [
        Table(
            title=f"One turn of {STEPS} steps of a bead in a trap [µs]",
            head=("worlds", "`step`", "`step`, ends, `reset`", "the same captured"),
            rows=[(f"{w:,}", *(c[n].times(1e6).text() for n in ("plain", "ends", "graph"))) for w, c in costs.items()],
        ),
        Table(
            title=f"{LONG} steps of {many:,} worlds of which some are in motion",
            head=("in motion", "time relative to all"),
            rows=[(f"{100 * part:g} %", ratio.text()) for part, ratio in ended.items()],
            note=f"With episodes over without, all in motion: {over.text('.3f')}.",
        ),
        Table(
            title="A step of the shipped channel, and with an inlet in place of its period",
            head=("worlds", "periodic [ms]", "with an inlet, relative to that"),
            rows=[(f"{w:,}", c["periodic"].times(1e3).text(), c["open"].text()) for w, c in inlets.items()],
        ),
    ]
    data = {
        "calls": {str(w): {n: vars(q) for n, q in c.items()} for w, c in costs.items()},
        "ended": {str(p): vars(q) for p, q in ended.items()},
        "episodes": vars(over),
        "inlets": {str(w): {n: vars(q) for n, q in c.items()} for w, c in inlets.items()},
    }
    if devices:
        ratios = {len(some): shard_ratios(some, shared, rounds) for some in first_of(devices)}
        tables.append(
            Table(
                title="Several devices over one [times as fast]",
                head=("devices", f"{shared:,} worlds on each (weak)", f"{shared:,} worlds in all (strong)"),
                rows=[(str(n), found["weak"].text(".4g"), found["strong"].text(".4g")) for n, found in ratios.items()],
            )
        )
        data["devices"] = {str(n): {k: vars(q) for k, q in found.items()} for n, found in ratios.items()}
    asked = f"--devices {' '.join(devices)}" if devices else ""
    return Section(name="worlds", kind=kind, machine=Machine.look(place), tables=tables, data=data, asked=asked)


if __name__ == "__main__":
    command(
        measure,
        "Worlds that end and start anew, and worlds on several devices.",
        rounds=9,
        devices={"nargs": "+", "default": (), "help": "devices that share worlds: cuda:0 cuda:1 …"},
        calls={"type": positive, "nargs": "+", "default": CALLS, "help": "worlds for which a call is timed"},
    )
