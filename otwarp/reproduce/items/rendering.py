"""Accuracy of force rendering: what two chains render while a hand sweeps through a trap, beside the model's force."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from otwarp.haptics.check.fidelity import Sweep, release, sweep, touch
from otwarp.haptics.core.config import TOUCH_QUANTUM, HandConfig
from otwarp.reproduce.drawing import FAINT, INK, OURS, PAPER, drawn, letter, write_csv
from otwarp.reproduce.item import Comparison, Figure, Request, Result, Table, Value, shown
from otwarp.reproduce.items.handle import BEAM, law
from otwarp.reproduce.measures import Agreement, agreement

GAIN = 0.04
"""Force on the hand [N/pN]: the largest one is 1.3 N."""

PAPERS = {"axial": (5.460e-5, 0.0074, 0.9525), "radial": (2.1005e-4, 0.0145, 0.9268)}
"""MSE, RMSE, R² of the paper."""

PRINTED = {"axial": "5.460·10⁻⁵", "radial": "2.1005·10⁻⁴"}
"""MSE as the paper prints it."""

SPEEDS = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
"""Largest speeds of the hand [m/s]."""

SWEEPS = 1.0
"""Periods of each sweep: they repeat themselves."""

DEFINITION = """A hand moves on a sine of ±1.1 cutoffs through a trap that holds one sphere at rest, along the beam or
across it, on a virtual clock at 1 kHz, with an encoder that resolves 55 µm as a Touch's is said to. In each servo
period the force that is rendered is set beside eq. 1: MSE = mean((rendered − model)²), RMSE = √MSE, R² = 1 −
Σ(rendered − model)²/Σ(model − mean)², the paper's measures. Forces on the hand are divided by the force gain and by
n·P/c, so that they are in the dimensionless Q of optical forces, like the paper's by their size. The law is the
continuous fit of item `force_curves`. `stable` is our chain with a Touch's preset and passivity control; `paper` is
the release's: a low-pass of the hand's motion with α = 0.05 at 1 kHz, states at 60 Hz, a low-pass of the force with α
= 0.05 at every message of trap and robot (120 Hz, τ = 0.16 s). Its model is eq. 1 at the trap's place as the
simulation published it, the place from which the release computes its force."""

DIFFERENCE = """The paper measures a running session of its own, with filters and delays inside, on a motion that is not
published; so its R² holds the lag of its filter. With the lag of the release's loop the R² of the paper comes out when
the hand takes the time given in the table to cross the trap: a slow motion, of some seconds. Our chain computes the
force at servo rate from the hand's own position and filters nothing: what is left is the encoder, and in fast motion
what passivity control takes away. That a device holds a force for a period of 1 ms is in neither figure."""

INCOMPARABLE = (
    "The motion behind the paper's figures is not published; R² of a chain with a lag is a statement about the "
    "motion as "
    "much as about the chain.",
    "The unit of its forces is not stated. MSE/(1 − R²) gives the spread of its model force: 0.034 axial, 0.054 "
    "radial. "
    "Those of our sweeps are in the table; MSE and RMSE scale with them, R² does not.",
)


def run(request: Request) -> Result:
    """Sweep with both chains, find the motion that gives the paper's R², draw."""
    rows: dict[str, dict[str, list[tuple[float, Agreement]]]] = {}
    speeds = SPEEDS[1:] if request.quick else SPEEDS
    for chain in ("stable", "paper"):
        rows[chain] = {}
        for axis in PAPERS:
            request.say(f"{chain} chain, {axis}")
            rows[chain][axis] = [(v, judged(swept(chain, axis, v))) for v in speeds]
    matched = {axis: _matched(axis) for axis in PAPERS}
    sweeps = {(chain, axis): swept(chain, axis, matched[axis]) for chain in ("stable", "paper") for axis in PAPERS}
    exact = {axis: judged(swept("stable", axis, matched[axis], quantum=0.0)) for axis in PAPERS}
    for (chain, axis), one in sweeps.items():
        columns = {"time_s": one.time, "rendered_q": _in_q(one.rendered), "model_at_trap_q": _in_q(one.at_trap),
                   "model_at_hand_q": _in_q(one.model)}  # fmt: skip
        write_csv(request.folder / f"{chain}_{axis}.csv", columns)
    _draw(request.folder / "rendering.png", sweeps, rows, matched)
    found = {key: judged(one) for key, one in sweeps.items()}
    return Result(
        comparisons=_comparisons(found, exact),
        definition=DEFINITION,
        difference=DIFFERENCE,
        incomparable=INCOMPARABLE,
        computed={"motion": f"one period of a sine at each of {len(speeds)} speeds, both chains, both axes",
                  "statistics": "none: a virtual clock, no noise; the same on every machine"},
        tables=(_by_speed(rows), _at_match(sweeps, found, matched)),
        figures=(Figure(file="rendering.png", caption="Force rendering. (a, b) Rendered against model force in Q while "
                        "the hand crosses the trap at the speed at which the release's chain has the paper's R². (c) "
                        "R² "
                        "over the time that the hand takes from one edge of the trap to the other."),),
        files={f"{chain}_{axis}.csv": f"force over time, {chain} chain, {axis}" for chain, axis in sweeps},
        numbers=_numbers(rows, matched, found, exact),
    )  # fmt: skip


def hand(chain: str) -> HandConfig:
    """The chain by its name, with the gain of the item."""
    return touch(force_gain=GAIN) if chain == "stable" else release(force_gain=GAIN)


def swept(chain: str, axis: str, speed: float, *, quantum: float = TOUCH_QUANTUM) -> Sweep:
    """A sweep of the fitted law at 20 mW, with an encoder that resolves so much [m]."""
    laws = {"radial": law("radial"), "axial": law("axial")}
    return sweep(hand(chain), axis, speed, **laws, power=BEAM.power, quantum=quantum, sweeps=SWEEPS)


def judged(one: Sweep) -> Agreement:
    """Of a sweep, in Q."""
    return agreement(_in_q(one.rendered), _in_q(one.at_trap))


def crossing(axis: str, speed: float) -> float:
    """Time [s] from one edge of the trap to the other at the largest speed [m/s]."""
    return 2.0 * law(axis).cutoff / hand("paper").motion_gain / speed


def _in_q(force: np.ndarray) -> np.ndarray:
    return force / (GAIN * BEAM.force_scale)


def _matched(axis: str) -> float:
    """Largest speed of the hand [m/s] at which the release's chain has the paper's R²."""
    low, high = math.log(2e-3), math.log(0.2)
    for _ in range(12):
        middle = 0.5 * (low + high)
        good = judged(swept("paper", axis, math.exp(middle))).r_squared > PAPERS[axis][2]
        low, high = (middle, high) if good else (low, middle)
    return math.exp(0.5 * (low + high))


def _comparisons(found: dict[tuple[str, str], Agreement], exact: dict[str, Agreement]) -> tuple[Comparison, ...]:
    rows = []
    for axis, (mse, rmse, r_squared) in PAPERS.items():
        ours, theirs = found["stable", axis], found["paper", axis]
        rows += [
            Comparison(what=f"R², {axis}", paper=Value(number=r_squared, text=f"{r_squared}"), grade="S", key=True,
                       ours=Value(number=ours.r_squared, text=f"{ours.r_squared:.6f}"),
                       remark=f"our chain; with an exact encoder {exact[axis].r_squared:.6f}"),
            Comparison(what=f"R², {axis}, the release's chain in our hands", paper=Value(number=r_squared,
                       text=f"{r_squared}"), grade="S", ours=Value(number=theirs.r_squared,
                       text=f"{theirs.r_squared:.4f}"), remark="by choice of the motion, see below"),
            Comparison(what=f"MSE, {axis}", unit="Q²", paper=Value(number=mse, text=PRINTED[axis]), grade="S",
                       ours=Value(number=ours.mse), remark=f"the release's chain: {shown(theirs.mse)}"),
            Comparison(what=f"RMSE, {axis}", unit="Q", paper=Value(number=rmse, text=f"{rmse}"), grade="S",
                       ours=Value(number=ours.rmse), remark=f"the release's chain: {shown(theirs.rmse)}"),
        ]  # fmt: skip
    return tuple(rows)


def _by_speed(rows: dict[str, dict[str, list[tuple[float, Agreement]]]]) -> Table:
    lines = []
    for n, (speed, _) in enumerate(rows["stable"]["axial"]):
        cells = [f"{rows[chain][axis][n][1].r_squared:.5f}" for chain in rows for axis in PAPERS]
        times = [f"{crossing(axis, speed):.3g}" for axis in PAPERS]
        lines.append((f"{1e3 * speed:g}", *times, *cells))
    head = ("largest speed [mm/s]", "crossing, axial [s]", "crossing, radial [s]", "stable, axial", "stable, radial",
            "paper mode, axial", "paper mode, radial")  # fmt: skip
    return Table(
        title="R² by the speed of the hand",
        head=head,
        rows=tuple(lines),
        note="100 µm of trap per metre of hand. Crossing: from one cutoff to the other at the largest speed.",
    )


def _at_match(
    sweeps: dict[tuple[str, str], Sweep], found: dict[tuple[str, str], Agreement], matched: dict[str, float]
) -> Table:
    lines = []
    for axis, (mse, _, r_squared) in PAPERS.items():
        spread = float(np.std(_in_q(sweeps["paper", axis].at_trap)))
        lines.append((axis, f"{crossing(axis, matched[axis]):.2f}", f"{1e3 * matched[axis]:.1f}",
                      f"{math.sqrt(mse / (1.0 - r_squared)):.4f}", f"{spread:.4f}",
                      f"{found['paper', axis].rmse / spread:.4f}", f"{math.sqrt(1.0 - r_squared):.4f}"))  # fmt: skip
    head = ("axis", "crossing time [s]", "largest speed [mm/s]", "spread of model force, paper [Q]", "ours [Q]",
            "RMSE over spread, release's chain", "the paper's")  # fmt: skip
    return Table(
        title="The motion at which the release's chain has the paper's R²",
        head=head,
        rows=tuple(lines),
        note="The paper's spread is derived from its own MSE and R²; RMSE over spread is √(1 − R²).",
    )


def _numbers(
    rows: dict[str, dict[str, list[tuple[float, Agreement]]]],
    matched: dict[str, float],
    found: dict[tuple[str, str], Agreement],
    exact: dict[str, Agreement],
) -> dict[str, object]:
    by_speed = {f"{chain} {axis}": [{"speed_m_s": v, "r_squared": a.r_squared, "rmse_q": a.rmse} for v, a in some]
                for chain, axes in rows.items() for axis, some in axes.items()}  # fmt: skip
    at = {f"{chain} {axis}": {"mse": a.mse, "rmse": a.rmse, "r_squared": a.r_squared}
          for (chain, axis), a in found.items()}  # fmt: skip
    times = {axis: crossing(axis, v) for axis, v in matched.items()}
    return {"by_speed": by_speed, "at_match": at, "matched_speed_m_s": matched, "crossing_time_s": times,
            "exact_encoder_r_squared": {axis: a.r_squared for axis, a in exact.items()}}  # fmt: skip


def _draw(
    path: Path,
    sweeps: dict[tuple[str, str], Sweep],
    rows: dict[str, dict[str, list[tuple[float, Agreement]]]],
    matched: dict[str, float],
) -> None:
    with drawn(path, panels=(1, 3), size=(9.6, 3.0)) as ((first, second, third),):
        for axes, axis, which in ((first, "axial", "a"), (second, "radial", "b")):
            # another spread of the model force: the second half of the period shows the lag without the start
            theirs, ours = sweeps["paper", axis], sweeps["stable", axis]
            half = len(theirs.time) // 4
            axes.plot(_in_q(theirs.at_trap)[half:], _in_q(theirs.rendered)[half:], color=PAPER, lw=1.2,
                      label="release's chain")  # fmt: skip
            axes.plot(_in_q(ours.model), _in_q(ours.rendered), color=OURS, lw=1.6, label="our chain")
            axes.axline((0, 0), slope=1, color=INK, lw=0.6, ls=":")
            axes.set(xlabel="model force (Q)", ylabel="rendered force (Q)")
            axes.legend(loc="upper left")
            letter(axes, which, f"{axis}, {crossing(axis, matched[axis]):.1f} s per crossing")
        for axis, line in (("axial", "-"), ("radial", (0, (4, 2)))):
            for chain, colour, name in (("stable", OURS, "our chain"), ("paper", PAPER, "release's chain")):
                some = rows[chain][axis]
                third.semilogx([crossing(axis, v) for v, _ in some], [a.r_squared for _, a in some], color=colour,
                               ls=line, marker="o", ms=2.6, label=f"{name}, {axis}")  # fmt: skip
            third.axhline(PAPERS[axis][2], color=FAINT, lw=0.7, ls=line)
        third.text(0.02, 0.91, "paper: axial ——, radial – –", transform=third.get_yaxis_transform(), fontsize=7,
                   color=FAINT, va="top")  # fmt: skip
        third.set(xlabel="time to cross the trap (s)", ylabel="R²", ylim=(0.0, 1.04))
        third.legend(loc="lower right")
        letter(third, "c", "R² is about the motion")
