"""What the haptic chain renders and costs: Z-width, fidelity of the force, loop jitter, latency, cost of a step.

Z-width and fidelity run on a virtual clock and are the same on every machine; the rest is measured here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

from benchmarks.report import Section, command
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.device import pick_device
from otwarp.haptics.chain.passivity import stiffest
from otwarp.haptics.check import BUSY, CHECKED, STEPS, chain_costs, law_costs, mailbox_costs, time_calls
from otwarp.haptics.check.fidelity import determination, sweep, touch
from otwarp.haptics.check.timing import (
    STATE_RATE,
    Jitter,
    Percentiles,
    check_hand,
    check_scene,
    measure_jitter,
    measure_latency,
)
from otwarp.haptics.check.zwidth import DEVICE, HIGH, PASSIVE, RATE, BareDevice, chain_width, widths
from otwarp.haptics.core.config import TOUCH_CHAIN, TOUCH_QUANTUM, TOUCH_SAFETY, PassivityConfig
from otwarp.haptics.force import local_model
from otwarp.haptics.force.law import Law, TableLaw
from otwarp.laws import TrapLaw
from otwarp.optics import Beam, Particle, build_table
from otwarp.teleop.operators.servo import compile_laws

RADIAL = TrapLaw(stiffness=0.6, threshold=0.6, inverse_square=0.17, offset=-0.1122, cutoff=1.2, power=1.0)
AXIAL = TrapLaw(stiffness=0.2, threshold=0.9, inverse_square=0.20, offset=-0.0669, cutoff=1.6, power=1.0)
"""Per mW. At 20 mW, 100 µm/m and 0.2 N/pN: 240 and 80 N/m."""

POWER, FORCE_GAIN = 20.0, 0.2
SPEEDS = (0.01, 0.05, 0.1, 0.2)
"""Peak speeds of the hand along the line [m/s]."""

PAPER_R2 = (0.9525, 0.9268)
"""R² of the paper, axial and radial, by its own definitions and for its own running session."""

STIFFEST = 200_000.0
"""Largest spring tried in the rows of passivity control [N/m]."""

HOLDS = (0.001, 0.002, 0.004, 0.008, 0.02, 0.1)
"""Longest holds between two commands [s]."""

SECONDS = 8.0
"""Length of each measurement of jitter [s]."""


def fidelity(axis: str, speed: float, *, quantum: float, sweeps: float = 3.0, hold: float = 0.0) -> float:
    """R² of the rendered against the model force, each period, on a sine of ±1.1 cutoff through the trap.

    Args:
        axis: `axial` or `radial`.
        speed: Peak speed [m/s].
        quantum: Resolution of the encoder [m], 0 for exact; the model is taken at the true position.
        sweeps: How many periods of the sine.
        hold: Longest hold that passivity control expects at least [s].
    """
    config = touch(hold, force_gain=FORCE_GAIN)
    laws = {"radial": RADIAL, "axial": AXIAL}
    found = sweep(config, axis, speed, **laws, power=POWER, quantum=quantum, sweeps=sweeps)
    return determination(found.rendered, found.model)


def width_table(data: dict[str, Any], *, high: float) -> Table:
    """Z-width, as `otwarp haptics check` has it, and up to the stiff end."""
    rows = []
    for one in widths():
        if one.open_ended:  # what the check only bounds is found below
            continue
        reference = "" if one.reference is None else f"{one.reference:g} ({one.source})"
        rows.append((one.loop, f"{one.found:.4g}", "", reference))
        data[one.loop] = one.found
    limited = replace(TOUCH_SAFETY, ramp_time=0.0)
    cases: tuple[tuple[str, dict[str, Any]], ...] = (
        ("stable", {"chain": PASSIVE}),
        ("stable, the Touch's slew limit, clamp and guard", {"chain": PASSIVE, "safety": limited}),
        (
            "the same with a 55 µm encoder that the chain knows of",
            {"chain": TOUCH_CHAIN, "safety": limited, "device": BareDevice(quantum=TOUCH_QUANTUM)},
        ),
    )
    for name, how in cases:
        spring, wall = (chain_width(**how, wall=wall, high=high) for wall in (False, True))
        data[name] = {"spring": spring, "wall": wall}
        rows.append((name, *(f"≥ {v:.6g}" if v >= high else f"{v:.4g}" for v in (spring, wall)), ""))
    return Table(
        title=f"Z-width of a bare device ({DEVICE}) at {RATE:g} Hz, virtual clock",
        head=("loop", "spring [N/m]", "wall [N/m]", "theory, or the paper [N/m]"),
        rows=rows,
        note=f"Springs up to {high:g} N/m were tried. How to read the stiff end is in [haptics.md](../haptics.md).",
    )


def fidelity_table(data: dict[str, Any], speeds: Sequence[float]) -> Table:
    """R² at several speeds, beside the paper's."""
    kinds = [(axis, quantum) for quantum in (0.0, TOUCH_QUANTUM) for axis in ("axial", "radial")]
    rows = []
    for speed in speeds:
        found = [fidelity(axis, speed, quantum=quantum) for axis, quantum in kinds]
        data[f"{1e3 * speed:g} mm/s"] = found
        rows.append((f"{1e3 * speed:g} mm/s", *(f"{v:.6f}" for v in found)))
    rows.append(("paper, its definitions", *(f"{v:g}" for v in PAPER_R2), "", ""))
    return Table(
        title="R² of rendered against model force, by the hand's peak speed",
        head=("peak speed", "axial", "radial", "axial, 55 µm encoder", "radial, 55 µm encoder"),
        rows=rows,
    )


def hold_table(data: dict[str, Any], holds: Sequence[float] = HOLDS) -> Table:
    """What passivity control leaves of a force that may be held for long."""
    rows, config = [], PassivityConfig()
    for hold in holds:
        spring, found = stiffest(config, 1.0 / RATE, hold), fidelity("radial", 0.05, quantum=0.0, hold=hold)
        data[f"{1e3 * hold:g} ms"] = {"spring": spring, "fidelity": found}
        rows.append((f"{1e3 * hold:g} ms", f"{spring:.3g}", f"{found:.4f}"))
    return Table(
        title="What passivity control leaves, by the longest hold that it expects",
        head=("hold", "stiffest spring rendered as it is [N/m]", "R² at 240 N/m and 50 mm/s"),
        rows=rows,
    )


def _micro(spread: Percentiles) -> tuple[str, ...]:
    return tuple(f"{1e6 * v:.3g}" for v in (spread.p50, spread.p99, spread.p999, spread.max))


PERCENTILES = ("p50", "p99", "p99.9", "max")


def jitter_table(data: dict[str, Any], seconds: float) -> Table:
    """Lateness of the servo's loop with and without what the system grants, idle and loaded."""
    rows = []
    for realtime in (True, False):
        for busy in (0, BUSY):
            one: Jitter = measure_jitter(seconds, busy=busy, realtime=realtime)
            granted = ", ".join(g.what for g in one.grants if g.granted) or "nothing"
            rows.append(
                (granted, f"{busy} busy" if busy else "idle", *_micro(one.lateness), f"{one.skipped} of {one.cycles}")
            )
            data[f"{'asked' if realtime else 'not asked'}, {busy} busy"] = asdict(one)
    return Table(
        title=f"Lateness of a 1 kHz loop [µs], {seconds:g} s each", head=("granted", "beside", *PERCENTILES, "dropped"),
        rows=rows,
    )  # fmt: skip


def latency_table(data: dict[str, Any], seconds: float) -> Table:
    """In the servo process with a virtual device."""
    found = measure_latency(seconds, code=compile_laws(CHECKED)[0])
    data |= asdict(found)
    rows = [
        ("sample of the hand to the force for it", *_micro(found.sample)),
        (f"state published ({STATE_RATE:g}/s) to the first force that knows it", *_micro(found.state)),
    ]
    return Table(title="Latency in the servo process [µs]", head=("from, to", *PERCENTILES), rows=rows)


def optical_laws() -> dict[str, Law]:
    """Force tables of optics, as a hand feels them."""
    found: dict[str, Law] = {}
    for interpolation in ("bilinear", "bicubic"):
        table = build_table(Beam(), Particle(radius=1.525, index=1.52), tolerance=1e-3, interpolation=interpolation)
        found[f"{interpolation} table"] = TableLaw.of(table)
    return found


def force_table(data: dict[str, Any], calls: int, tables: Mapping[str, Law]) -> Table:
    """The force alone: compiled, in Python, and how many times faster."""
    config, rows, (isotropic, split) = check_hand(), [], CHECKED[0]
    for what, law in ({"eq. 1 in all directions": isotropic, "radial and axial curve": split} | dict(tables)).items():
        laws = {i: (law,) for i in config.traps}
        code, said = compile_laws(laws)
        spent = []
        for one in (code, None):
            model, scene = local_model(config, laws, code=one), check_scene(1, 0.0)
            model.refresh(scene, {trap.index: trap.position for trap in scene.traps})
            force = model.force
            spent.append(
                time_calls(lambda n, force=force: force(1e-4 * (n % 1000), 0.1, 0.2), calls if one else calls // 10)
            )
        rows.append((what, *_micro(spent[0]), f"{1e6 * spent[1].p50:.3g}", f"{spent[1].p50 / spent[0].p50:.0f}"))
        data[what] = {"law": said, "compiled": asdict(spent[0]), "in Python": asdict(spent[1])}
    return Table(
        title="The force alone [µs]: 10 spheres × 3 traps, all in reach, the same bits from both",
        head=("law", *(f"compiled, {name}" for name in PERCENTILES), "in Python, p50", "times faster"),
        rows=rows,
    )


def cost_table(data: dict[str, Any], steps: int, tables: Mapping[str, Law]) -> Table:
    """Steps and mailboxes."""
    costs = [*chain_costs(steps, compile_laws(CHECKED)[0])]
    for what, law in tables.items():
        code, _ = compile_laws({0: (law,)})
        for hands, also in ((1, ""), (2, ", two hands")):
            costs += law_costs(f"stable, {what}{also}", check_hand(), law, code, hands=hands, steps=steps)
    costs += mailbox_costs(steps)
    data |= {cost.what: asdict(cost.time) for cost in costs}
    return Table(
        title="Cost of one call [µs]; a step has 10 spheres and 3 traps, all pairs in reach",
        head=("call", *PERCENTILES),
        rows=[(cost.what, *_micro(cost.time)) for cost in costs],
        note="Measured without real-time priority: the upper percentiles are those of other processes.",
    )


def measure(
    device: str = "cpu",
    *,
    rounds: int = 1,
    seconds: float = SECONDS,
    speeds: Sequence[float] = SPEEDS,
    steps: int = STEPS,
    high: float = STIFFEST,
    tables: Callable[[], Mapping[str, Law]] = optical_laws,
) -> Section:
    """All tables; `rounds` makes the measurements with a clock that much longer. The servo runs on the CPU."""
    machine = Machine.look(pick_device(device))
    data: dict[str, Any] = {name: {} for name in ("width", "fidelity", "hold", "jitter", "latency", "forces", "costs")}
    laws = tables()
    found = [
        width_table(data["width"], high=max(high, HIGH)),
        fidelity_table(data["fidelity"], speeds),
        hold_table(data["hold"]),
        jitter_table(data["jitter"], rounds * seconds),
        latency_table(data["latency"], rounds * seconds),
        force_table(data["forces"], 10 * steps, laws),
        cost_table(data["costs"], steps, laws),
    ]
    kind = "cpu" if pick_device(device).is_cpu else "cuda"
    return Section(name="haptics", kind=kind, machine=machine, tables=found, data=data)


if __name__ == "__main__":
    command(measure, "What the haptic chain renders and costs.", rounds=1)
