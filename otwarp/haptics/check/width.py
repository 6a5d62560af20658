"""Z-width here and in the paper, and what limits the force that a hand can feel."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from otwarp.haptics.chain.paper_mode import RELEASE_ALPHA, RELEASE_RATE
from otwarp.haptics.check.zwidth import BARE, PASSIVE, chain_width, paper_width
from otwarp.haptics.core.presets import TOUCH_DAMPING, TOUCH_MASS, TOUCH_QUANTUM, TOUCH_SAFETY

RATE = 1000.0
"""Of the servo [Hz]."""

HIGH = 20_000.0
"""Stiffest spring that is tried [N/m]; a chain that is stable there passes for stable everywhere."""

PAPER_FILTERED, PAPER_RELEASE = 10.3, 1.4
"""Largest stable stiffness of the release's chain: α = 0.05 at 1 kHz, and at 120 Hz with 5 ms of delay [N/m]; from the
same device on a virtual clock."""

DELAY = 0.005


@dataclass(frozen=True, slots=True)
class Width:
    """A row of the table of Z-widths.

    Attributes:
        loop: What renders.
        found: Largest stable stiffness of a spring [N/m].
        open_ended: Whether it is the stiffest that was tried, so that the true one is larger.
        reference: What theory or the paper has [N/m], None for nothing.
        source: Of the reference.
    """

    loop: str
    found: float
    open_ended: bool
    reference: float | None
    source: str


def widths(progress: Callable[[str], None] = lambda line: None) -> tuple[Width, ...]:
    """Z-width of a bare 0.15 kg, 0.2 N·s/m device on a virtual clock: no hand, no machine is in it. Takes some 15 s."""
    cases: tuple[tuple[str, Callable[[], float], float | None, str], ...] = (
        ("stable, passivity control off", lambda: chain_width(BARE, high=2000.0), 2.0 * TOUCH_DAMPING * RATE, "2b/T"),
        ("stable", lambda: chain_width(PASSIVE, high=HIGH), None, ""),
        ("stable, a wall", lambda: chain_width(PASSIVE, wall=True, high=HIGH), None, ""),
        ("paper, α = 0.05 per message at 1 kHz", lambda: paper_width(rate=RATE), PAPER_FILTERED, "b/τ"),
        (
            f"paper, {2.0 * RELEASE_RATE:g} messages/s, {1e3 * DELAY:g} ms late",
            lambda: paper_width(rate=2.0 * RELEASE_RATE, delay=DELAY),
            PAPER_RELEASE,
            "the release's loop",
        ),
    )
    found = []
    for loop, measure, reference, source in cases:
        progress(f"Z-width: {loop}")
        value = measure()
        found.append(Width(loop, value, value >= HIGH, reference, source))
    return tuple(found)


@dataclass(frozen=True, slots=True)
class FeltLimit:
    """Something that bounds what is felt, and why."""

    what: str
    value: str
    why: str


def limits() -> tuple[FeltLimit, ...]:
    """What is limited in the Touch's preset, and in the paper's chain, by its numbers."""
    period, b, safety = 1.0 / RATE, TOUCH_DAMPING, TOUCH_SAFETY
    tau = -period / math.log(1.0 - RELEASE_ALPHA)
    step = 1e4 * TOUCH_QUANTUM
    return (
        FeltLimit(
            "stiffness without passivity control",
            f"2b/T = {2.0 * b / period:.0f} N/m",
            "a force held for a period is half a period late and gives energy; only the device's friction takes it",
        ),
        FeltLimit(
            "stiffness behind a filter of the force",
            f"b/τ = {b / tau:.1f} N/m",
            f"α = {RELEASE_ALPHA:g} at {RATE:g} Hz is a lag of {1e3 * tau:.1f} ms, and friction must pay for it",
        ),
        FeltLimit(
            "smoothness of a stiff wall",
            f"{step:.2f} N per step at 10 kN/m",
            f"the encoder resolves {1e6 * TOUCH_QUANTUM:.0f} µm: a vibration stays, bounded",
        ),
        FeltLimit(
            "change of the force",
            f"{safety.slew:g} N/s, {safety.slew * period:g} N per period",
            "slew limit: no output jumps, whatever happens before it",
        ),
        FeltLimit("force", f"{safety.clamp:g} N", "clamp: what the device can render"),
        FeltLimit(
            "force that lasts",
            f"{safety.continuous_force:g} N rms over {safety.thermal_time:g} s",
            "continuous-force guard: what its motors bear",
        ),
        FeltLimit(
            "force after the last state",
            f"falls from {1e3 * safety.decay_after:.0f} ms, zero at {1e3 * safety.disarm_after:.0f} ms",
            "watchdog: a simulation that died is not felt for ever",
        ),
    )


DEVICE = f"{TOUCH_MASS:g} kg, {TOUCH_DAMPING:g} N·s/m"
"""What all Z-widths are stated for."""
