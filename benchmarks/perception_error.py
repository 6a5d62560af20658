"""`python -m benchmarks.perception_error [--write]`: what late and wrong estimates do to SIMULATED operators.

Maps over delay and depth error at the shipped cell delivery, with the chain's force gain and with a weaker one; then
tilt and frame rate, estimates without time stamps, errors that last, errors across the beam, eyes at the twin.
Results are kept in out/perception_error, where it goes on if it was interrupted. `--write` puts the tables between the
markers of docs/operators_perception.md, and the map of the weaker gain into docs/images.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.report import positive, run, save_page
from benchmarks.validation import put_on_page
from otwarp.device import pick_device
from otwarp.operators.perception.errors import Perception
from otwarp.operators.perception.figure import LABELS, draw_maps
from otwarp.operators.perception.folder import run_sweep
from otwarp.operators.perception.summary import Maps, maps_of
from otwarp.operators.perception.sweep import Sweep
from otwarp.operators.study import OperatorStudy
from otwarp.scene import Scene

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "operators_perception.md"
PICTURE = ROOT / "docs" / "images" / "operators_perception.png"
BEGIN, END = "<!-- begin perception error -->", "<!-- end perception error -->"
OUT = ROOT / "out" / "perception_error"
WEAK = 0.01
"""Force gain at which haptics do no harm in the model [N/pN]; the chain's own is 0.05."""
TRIALS = {"cpu": 816, "cuda": 16_384}
"""Trials at once, at most: of whole operators."""
NETWORKS = ROOT / "docs" / "benchmarks" / "vision_networks.md"
BLOCK = "<!-- begin vision_networks cuda -->", "<!-- end vision_networks cuda -->"
"""Between these it has networks of whole images."""
OURS = {
    "small, pose, focus_blocks": "small (ours, blocks of focus)",
    "resnet18, pose, focus_blocks": "ResNet18 (ours, blocks of focus)",
}
"""This project's networks there, on the split that leaks nothing, and what the map calls them."""
COLUMNS = {
    "success": ("delivered", "{:.2f}", 1.0),
    "lost": ("lost", "{:.2f}", 1.0),
    "contact_mean": ("contact [pN]", "{:.2f}", 1.0),
    "force_rmse_pn": ("force error [pN]", "{:.2f}", 1.0),
    "force_r2": ("R²", "{:.2f}", 1.0),
    "direction_error": ("direction [°]", "{:.0f}", 1.0),
    "missed": ("missed [ms]", "{:.1f}", 1e3),
    "false": ("false [ms]", "{:.1f}", 1e3),
    "work_peak": ("energy [µJ]", "{:.0f}", 1e6),
    "gain_1hz": ("gain 1 Hz", "{:.2f}", 1.0),
    "phase_1hz": ("phase 1 Hz [°]", "{:.0f}", 1.0),
    "phase_5hz": ("5 Hz [°]", "{:.0f}", 1.0),
    "sway": ("sway [µm]", "{:.0f}", 1e6),
    "limit_cycles": ("limit cycles", "{:.2f}", 1.0),
    "limit_cycle_hz": ("at [Hz]", "{:.1f}", 1.0),
}
"""Columns of the tables: heading, form, factor."""


def grid(*milliseconds: float, depth: Sequence[float] = (0.0,)) -> dict[str, tuple[float, ...]]:
    """Axes of delays [ms] and depth errors [µm]."""
    return {"delay": tuple(1e-3 * ms for ms in milliseconds), "depth_error": tuple(depth)}


SWEEPS: dict[str, dict[str, Any]] = {
    "weak": {"axes": grid(0, 25, 50, 75, 100, 150, 200, 300, 500, depth=(0.0, 0.1, 0.2, 0.4, 0.8, 1.6))},
    "chain": {"axes": grid(0, 20, 50, 100, 200, 300, 500, depth=(0.0, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6))},
    "pose": {"axes": {"tilt_error": (0.0, 5.0, 10.0), "frame_rate": (30.0, 60.0, 120.0, 500.0)}},
    "late_pose": {"axes": {"delay": (0.0, 0.05, 0.1), "tilt_error": (0.0, 5.0, 10.0, 20.0)}},
    "late_lateral": {"axes": {"delay": (0.0, 0.05, 0.1), "lateral_error": (0.0, 0.05, 0.1, 0.2)}},
    "unstamped": {"axes": grid(25, 50, 100, 200), "base": Perception(stamped=False)},
    "slow": {"axes": grid(0, 50, depth=(0.2, 0.4, 0.8)), "base": Perception(correlation=0.5)},
    "lateral": {"axes": grid(0, 50), "base": Perception(lateral_error=0.2)},
    "slow_lateral": {"axes": grid(0, 50), "base": Perception(lateral_error=0.2, correlation=0.5)},
    "eyes": {"axes": grid(50, 100, 200, 300), "base": Perception(eyes="twin")},
}
"""What is computed, by the name of its folder."""


def computed(name: str, operators: int, device: str) -> Maps:
    """A sweep, run or gone on with."""
    asked = SWEEPS[name]
    arms = 2 + int(np.prod([len(values) for values in asked["axes"].values()]))
    gain = None if name == "chain" else WEAK
    study = OperatorStudy(
        scene=Scene.load(ROOT / "scenes" / "cell_delivery.usda"), operators=operators, force_gain=gain
    )

    def say(done: int, count: int) -> None:
        """Tell how far it is."""
        print(f"{name}: part {done} of {count}", flush=True)

    trials = TRIALS["cpu" if pick_device(device).is_cpu else "cuda"]
    sweep = Sweep(study=study, chunk=arms * max(trials // arms, 1), repeats=4, **asked)
    return maps_of(run_sweep(sweep, OUT / name, device=device, progress=say))


def table(found: Maps, rows: Sequence[tuple[str, dict[str, float]]]) -> str:
    """Numbers of cells, each with its name."""
    columns = [name for name in COLUMNS if name in found.maps]
    lines = [f"| | {' | '.join(COLUMNS[name][0] for name in columns)} |", f"|---|{'---:|' * len(columns)}"]
    for said, row in rows:
        numbers = [row.get(name, np.nan) for name in columns]
        cells = ["" if np.isnan(value) else COLUMNS[name][1].format(value * COLUMNS[name][2])
                 for name, value in zip(columns, numbers, strict=True)]  # fmt: skip
        lines.append(f"| {said} | {' | '.join(cells)} |")
    return "\n".join(lines)


def beside(found: Maps) -> list[tuple[str, dict[str, float]]]:
    """Rows of what cells are set against."""
    return [("no haptics", found.beside["without"]), ("no error, no delay", found.beside["perfect"])]


def cells(found: Maps, **chosen: Sequence[float]) -> list[tuple[str, dict[str, float]]]:
    """Rows of the cells that have these values of axes, all where none are named; called by what differs."""
    wide = [name for name, values in found.axes.items() if len(values) > 1]
    rows = []
    for cell in np.ndindex(*(len(values) for values in found.axes.values())):
        at = {name: float(found.axes[name][n]) for name, n in zip(found.axes, cell, strict=True)}
        if all(any(np.isclose(at[name], value) for value in values) for name, values in chosen.items()):
            said = ", ".join(f"{LABELS[name][0].replace(' [', ' ').rstrip(']')}: {at[name] * LABELS[name][1]:g}"
                             for name in wide)  # fmt: skip
            rows.append((said, found.at(cell)))
    return rows


def our_errors(page: str) -> dict[str, float]:
    """Depth errors of this project's networks on blocks of focus [µm], means over seeds, as `NETWORKS` prints them."""
    block = page.split(BLOCK[0])[1].split(BLOCK[1])[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in block.splitlines() if line[:1] == "|"]
    head = next(row for row in rows if row[0] == "network, split")
    by_name = {row[0]: row[head.index("depth [µm]")] for row in rows if len(row) == len(head)}
    return {said: float(by_name[name].split("±")[0]) for name, said in OURS.items()}


def drawn(device: str, operators: int, picture: Path) -> Maps:
    """The map of the weaker gain, drawn."""
    weak = computed("weak", operators, device)
    draw_maps(weak, picture, networks=our_errors(NETWORKS.read_text(encoding="utf-8")))
    return weak


def report(device: str, operators: int, fewer: int, picture: Path) -> str:
    """All tables of the page; the map is drawn."""
    weak, chain = drawn(device, operators, picture), computed("chain", operators, device)
    names = ("pose", "late_pose", "late_lateral", "unstamped", "slow", "lateral", "slow_lateral", "eyes")
    pose, late_pose, late_lateral, unstamped, slow, lateral, slow_lateral, eyes = (
        computed(name, fewer, device) for name in names
    )
    across = [(f"{said}, {how}", row) for how, found in (("new in every picture", lateral), ("for 0.5 s", slow_lateral))
              for said, row in cells(found)]  # fmt: skip
    corners = {"delay": (0.0, 0.05, 0.1, 0.2, 0.5), "depth_error": (0.0, 0.2, 0.8)}
    return "\n\n".join(
        [
            f"Force gain {WEAK:g} N/pN, {weak.operators} simulated operators in each of {weak.maps['success'].size} "
            "cells; some of them:",
            table(weak, [*beside(weak), *cells(weak, **corners)]),
            f"The chain's own force gain, {chain.asked['force gain']:g} N/pN, {chain.operators} simulated operators in "
            f"each of {chain.maps['success'].size} cells; some of them:",
            table(chain, [*beside(chain), *cells(chain, **corners)]),
            f"Tilt errors and frame rates, {pose.operators} simulated operators, {WEAK:g} N/pN as below:",
            table(pose, [*beside(pose), *cells(pose)]),
            f"Delays and tilt errors, {late_pose.operators} simulated operators:",
            table(late_pose, cells(late_pose)),
            f"Delays and errors along x and along y, {late_lateral.operators} simulated operators:",
            table(late_lateral, cells(late_lateral)),
            f"Late estimates beside the traps of now, {unstamped.operators} simulated operators:",
            table(unstamped, cells(unstamped)),
            f"Depth errors that are forgotten in {slow.asked['perception']['base']['correlation']:g} s, "
            f"{slow.operators} simulated operators:",
            table(slow, cells(slow)),
            f"Errors of 0.2 µm along x and along y, {lateral.operators} simulated operators:",
            table(lateral, across),
            f"Eyes that look at the late twin, {eyes.operators} simulated operators; without haptics they deliver "
            + ", ".join(f"{v:.2f}" for v in without_haptics(eyes))
            + ":",
            table(eyes, cells(eyes)),
        ]
    )


def without_haptics(found: Maps) -> np.ndarray:
    """Share of deliveries without haptics in the cells of a sweep whose eyes depend on them."""
    return np.ravel(found.maps["success"] - found.maps["success_minus_without"])


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="What late and wrong estimates do to simulated operators.")
    parser.add_argument("--device", default="cpu", help="cpu (default) or cuda:0")
    parser.add_argument("--operators", type=positive, default=96, help="of the two maps (default: 96)")
    parser.add_argument("--fewer", type=positive, default=48, help="of what else is asked (default: 48)")
    parser.add_argument("--write", action="store_true", help="write docs/operators_perception.md and its picture")
    parser.add_argument("--map", action="store_true", help="the picture of the weaker gain alone, and no tables")
    given = parser.parse_args()
    picture = PICTURE if given.write else OUT.with_suffix(".png")
    if given.map:
        print(f"{drawn(given.device, given.operators, picture).operators} simulated operators: {picture}")
        return
    text = report(given.device, given.operators, given.fewer, picture)
    print(text)
    if given.write:
        save_page(PAGE, put_on_page(PAGE.read_text(encoding="utf-8"), text, BEGIN, END))


if __name__ == "__main__":
    run(main)
