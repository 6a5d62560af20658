"""The signal chain: the stiffest spring that each loop renders, the release's filter, and how late forces are."""

from __future__ import annotations

import math
from pathlib import Path

from otwarp.haptics.chain.paper_mode import RELEASE_LAW, PaperForce, curve_of
from otwarp.haptics.check.timing import ServoLatency, measure_latency
from otwarp.haptics.check.zwidth import DEVICE, HIGH, PAPER_FILTERED, PAPER_RELEASE, Width, widths
from otwarp.haptics.core.config import RELEASE_ALPHA, RELEASE_GAIN, RELEASE_RATE, TOUCH_DAMPING, TOUCH_MASS
from otwarp.reproduce.drawing import INK, OURS, PAPER, drawn
from otwarp.reproduce.item import Comparison, Figure, Request, Result, Table, Value, shown
from otwarp.reproduce.measures import agreement

BARE_LIMIT = 414.0
"""Largest stable stiffness that a virtual-clock simulation of the bare loop gave at 1 kHz [N/m]; 2b/T is 400."""

MESSAGES, DISTANCE = 99, 0.05
"""After so many messages at that distance [scene units] the release's filter has almost settled."""

LEFT = 0.5
"""Where the axis of the figure begins [N/m]."""

DEFINITION = f"""A bare device, {DEVICE}, is let go on a rendered spring at 0.5 N, on a virtual clock; a stiffness is
stable when the largest speed in the last quarter of the run is no more than in the first. `paper` is the release's
force node, a low-pass with α = {RELEASE_ALPHA:g} at every message; an α means nothing without its rate: τ = −T/ln(1 −
α) = 19.5 samples. Latency is measured in the servo process of this machine with a virtual device, from a sample of
the hand to the force for it, and from a published state of the simulation to the first force that knows it."""

DIFFERENCE = """The figures beside ours were derived from the release's chain by simulation of the same bare device;
the paper states none. Theory: 2b/T = 400 N/m for a force that is held for a period T, b/τ = 10.3 N/m behind a filter.
Our chain filters nothing and bounds the energy that a hand is given (passivity control), so that the stiffest spring
tried is stable. In paper mode the same limits come out."""

INCOMPARABLE = (
    "No haptic device was available: a device is a mass with friction here, and its latency that of a virtual one.",
    "The paper states neither delay nor jitter of its loop; the 5 ms of the release's loop are assumed.",
)


def run(request: Request) -> Result:
    """Look for the stiffest springs, settle the release's filter, measure latency."""
    found = {one.loop: one for one in widths(request.say)}
    request.say("latency of the servo process")
    late = measure_latency(float(request.choose(3, 20)))
    settled = settled_force()
    _draw(request.folder / "chain.png", found)
    return Result(
        comparisons=_comparisons(found, settled, late),
        definition=DEFINITION,
        difference=DIFFERENCE,
        incomparable=INCOMPARABLE,
        computed={"Z-widths": "virtual clock, no noise: the same on every machine",
                  "latency": f"{late.cycles} cycles of the servo process at 1 kHz, not asked for real-time priority "
                  "beyond what the system grants"},
        tables=(_latency(late),),
        figures=(Figure(file="chain.png", caption="Stiffest spring that each loop renders on a bare device, by "
                                                  "simulation "
                        "on a virtual clock; arrows: the stiffest that was tried."),),
        numbers={"widths_n_m": {loop: one.found for loop, one in found.items()}, "settled_n": settled,
                 "latency_s": {"sample_p50": late.sample.p50, "sample_p99": late.sample.p99,
                               "state_p50": late.state.p50, "state_p99": late.state.p99}},
    )  # fmt: skip


def settled_force() -> float:
    """Force of the release's node [N] after `MESSAGES` messages at `DISTANCE`."""
    node = PaperForce(curve_of(RELEASE_LAW))
    node.robot_message((DISTANCE, 0.0, 0.0), 0.0)
    for n in range(MESSAGES):
        node.trap_message((0.0, 0.0, 0.0), n / (2.0 * RELEASE_RATE))
    return math.hypot(*node.force)


def _comparisons(found: dict[str, Width], settled: float, late: ServoLatency) -> tuple[Comparison, ...]:
    loops = list(found.values())
    bare, ours, wall, filtered, release = (one.found for one in loops)
    samples = -1.0 / math.log(1.0 - RELEASE_ALPHA)
    expected = RELEASE_GAIN * RELEASE_LAW.stiffness * DISTANCE * (1.0 - (1.0 - RELEASE_ALPHA) ** MESSAGES)
    return (
        Comparison(what="stiffest spring, 1 kHz, nothing filtered", unit="N/m", grade="D",
                   paper=Value(number=BARE_LIMIT), ours=Value(number=bare, text=f"{bare:.1f}"), remark="2b/T = 400"),
        Comparison(what="stiffest spring, α = 0.05 at 1 kHz", unit="N/m", paper=Value(number=PAPER_FILTERED), grade="D",
                   ours=Value(number=filtered), remark="paper mode; b/τ = 10.3"),
        Comparison(what="stiffest spring, the release's loop", unit="N/m", paper=Value(number=PAPER_RELEASE), grade="D",
                   ours=Value(number=release), remark="paper mode, 120 messages/s, 5 ms late", key=True),
        Comparison(what="stiffest spring, our chain", unit="N/m", paper=Value(text="–"), grade="",
                   ours=Value(number=ours, text=f"≥ {ours:,.0f}" if ours >= HIGH else f"{ours:.4g}"), key=True,
                   remark=f"passivity control; a wall ≥ {wall:,.0f}" if wall >= HIGH else f"a wall {wall:.4g}"),
        Comparison(what="time constant of α = 0.05", unit="samples", paper=Value(number=19.5), grade="D",
                   ours=Value(number=samples), remark="19.5 ms at 1 kHz, 0.16 s in the release's loop"),
        Comparison(what=f"force after {MESSAGES} messages at d = {DISTANCE:g}", unit="N", grade="D",
                   paper=Value(number=expected, text=f"{expected:.3f}"),
                   ours=Value(number=settled, text=f"{settled:.3f}"),
                   remark="α, gain and law of the release, by hand and by our node; difference "
                   f"{shown(agreement([settled], [expected]).mae, 1)}"),
        Comparison(what="hand to force, p50", unit="ms", ours=Value(number=1e3 * late.sample.p50),
                   remark=f"p99 {shown(1e3 * late.sample.p99)}; this machine"),
    )  # fmt: skip


def _latency(late: ServoLatency) -> Table:
    rows = [
        (name, *(shown(1e3 * v) for v in (one.p50, one.p99, one.p999, one.max)))
        for name, one in (("hand → force", late.sample), ("state of the simulation → force", late.state))
    ]
    return Table(
        title="Latency in the servo process of this machine [ms]",
        head=("from → to", "p50", "p99", "p99.9", "max"),
        rows=tuple(rows),
        note="In the release the force waits for messages of the simulator, and for its filter: τ = 0.16 s.",
    )


def _draw(path: Path, found: dict[str, Width]) -> None:
    with drawn(path, size=(7.2, 2.3)) as ((axes,),):
        for y, one in enumerate(reversed(list(found.values()))):
            colour = PAPER if one.loop.startswith("paper") else OURS
            axes.barh(y, one.found - LEFT, color=colour, height=0.62, left=LEFT)
            said = f"≥ {one.found:,.0f} N/m" if one.open_ended else f"{one.found:.4g} N/m"
            axes.text(1.15 * one.found, y, said, va="center", fontsize=8, color=colour)
            if one.reference is not None:
                axes.plot(one.reference, y, "|", ms=15, color=INK, mew=1.4)
        axes.set_yticks(range(len(found)), [one.loop for one in reversed(list(found.values()))])
        axes.set(xscale="log", xlim=(LEFT, 3e5))
        axes.set_xlabel(f"stiffest stable spring (N/m); {TOUCH_MASS:g} kg, {TOUCH_DAMPING:g} N·s/m; bars mark theory")
