"""Trials of a map spent where its contour may be, beside as many everywhere: on maps of known truth, and a real one.

`python -m benchmarks.adaptive --write` puts the tables between the markers of docs/benchmarks/study.md. On the known
maps P falls across a circle, so that the distance of a drawn contour from the true one can be said; a trial is a coin
that falls with P there, and the rules are the package's own. The real map is that of a bead in a tabulated trap.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import expit

import otwarp as ot
from benchmarks.report import PAGES, commit, run, save_page
from benchmarks.validation import put_on_page
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.device import pick_device
from otwarp.studies.stopping.intervals import interval
from otwarp.studies.stopping.rules import Stop

PAGE = PAGES / "study.md"
BEGIN, END = "<!-- begin adaptive -->", "<!-- end adaptive -->"
SCENE = Path(__file__).parents[1] / "scenes" / "table_trap.usda"
MAPS = {(8, 16): 400, (32, 32): 60, (64, 64): 16}
"""Points along either side, and how many maps of the size are made."""
WIDTH = 0.05
"""Of the fall of P, as a share of the map's side: from 0.9 to 0.1 over 4.4 of it."""
CENTRE, RADIUS = (-0.2, -0.1), 0.75
"""Of the circle on which P is one half, in sides of the map."""
HALF_WIDTHS = (0.05, 0.02)
LADDER = tuple(round(16 * math.sqrt(2.0) ** n) for n in range(19))
"""Trials of every point, of which the one is sought that gives the same error of the contour."""
REAL = ((8, 16), (32, 32))
"""Powers and starts of real maps."""


@dataclass(frozen=True)
class Found:
    """What trials of some maps gave.

    Attributes:
        trials: Of all points of a map, mean.
        error: Root mean square distance of the drawn contour from the true one, in sides of the map.
        half_width: Of the widest interval that holds one half.
        held: Share of all intervals that hold the truth.
    """

    trials: float
    error: float
    half_width: float
    held: float


def distance(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """From the true contour, in sides of the map; negative inside."""
    return np.hypot(x - CENTRE[0], y - CENTRE[1]) - RADIUS


def truth(shape: tuple[int, int]) -> np.ndarray:
    """P at the points of a map."""
    y, x = (np.linspace(0.0, 1.0, n) for n in shape)
    return expit(-distance(x[None], y[:, None]) / WIDTH)


def errors(p: np.ndarray) -> np.ndarray:
    """Distances of the corners of the drawn contour P = ½ from the true one, in sides of the map."""
    import contourpy

    y, x = (np.linspace(0.0, 1.0, n) for n in p.shape)
    lines = contourpy.contour_generator(x=x, y=y, z=p).lines(0.5)
    return np.concatenate([distance(line[:, 0], line[:, 1]) for line in lines])  # type: ignore[index]


def tossed(rule: Stop, p: np.ndarray, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Counts and trials of points with chances `p`, as a rule has them."""
    counts, done = np.zeros(p.size, dtype=int), np.zeros(p.size, dtype=int)
    while np.any((wanted := rule.wanted(counts[None], done)) > done):
        counts = counts + random.binomial(np.maximum(wanted - done, 0), p.ravel())
        done = np.maximum(wanted, done)
    return counts, done


def judged(rule: Stop, shape: tuple[int, int], seed: int = 1) -> Found:
    """What a rule takes and gives on maps of a size."""
    p, random = truth(shape), np.random.Generator(np.random.Philox(seed))
    trials, squares, widest, held = [], [], 0.0, []
    for _ in range(MAPS[shape]):
        counts, done = tossed(rule, p, random)
        low, high = (end[0] for end in rule.interval(counts[None], done))
        trials.append(done.sum())
        squares.append(errors((counts / done).reshape(shape)) ** 2)
        widest = max(widest, float(np.max(np.where((low <= 0.5) & (high >= 0.5), 0.5 * (high - low), 0.0))))
        held.append(np.mean((low <= p.ravel()) & (p.ravel() <= high)))
    return Found(float(np.mean(trials)), float(np.sqrt(np.mean(np.concatenate(squares)))), widest, float(np.mean(held)))


def enough(half_width: float) -> int:
    """Trials of every point at which an interval at one half is as narrow."""
    return next(n for n in range(16, 10**5) if np.diff(interval(n // 2, n), axis=0)[0] <= 2.0 * half_width)


def for_error(error: float, ladder: Sequence[float]) -> float:
    """Trials of every point that give this error of the contour, between those of `LADDER`, whose errors fall."""
    falling = np.minimum.accumulate(ladder)
    return float(np.exp(np.interp(-np.log(error), -np.log(falling), np.log(LADDER))))


def known_rows(shape: tuple[int, int]) -> list[tuple[str, ...]]:
    """Rows of a map of a size: every rule at every half-width."""
    ladder = [judged(ot.trials(n), shape).error for n in LADDER]
    size, rows = f"{shape[0]} × {shape[1]}", []
    for width in HALF_WIDTHS:
        rules = {
            "the same everywhere": ot.trials(enough(width)),
            "half_width": ot.half_width(width),
            "contour, by a sequence": ot.contour(0.5, half_width=width, method="sequence"),
            "contour": ot.contour(0.5, half_width=width),
        }
        found = {name: judged(rule, shape) for name, rule in rules.items()}
        everywhere = found["the same everywhere"].trials
        for name, one in found.items():
            alike = for_error(one.error, ladder) * shape[0] * shape[1]
            gain = "1" if name == "the same everywhere" else f"{alike / one.trials:.2g}"
            row = (f"{one.trials:,.0f}", f"{everywhere / one.trials:.2g}", f"{100.0 * one.error:.2g}", gain)
            rows.append((f"{size}, ± {width:g}, {name}", *row, f"{one.half_width:.3f}", f"{100.0 * one.held:.1f}"))
    return rows


def real_rows(shape: tuple[int, int], half_width: float = 0.05) -> list[tuple[str, ...]]:
    """Rows of a map of a bead in a tabulated trap, run."""
    powers, starts = shape
    axes = {
        "trap_power": ot.grid(0.1, 5.0, powers, unit="mW", spacing="log"),
        "start.x:/World/bead": ot.grid(0.2, 2.9, starts, unit="µm"),
    }
    rows = []
    ot.Study(SCENE, observables=[ot.trapped(until=1.0)], stop=ot.trials(1)).compute([0], device="cpu")  # compiles
    rules = {"half_width": ot.half_width(half_width), "contour": ot.contour(0.5, half_width=half_width)}
    for name, rule in rules.items():
        study = ot.Study(SCENE, axes=axes, observables=[ot.trapped(until=1.0)], stop=rule, seed=7)
        study.plan()
        begun = time.process_time()
        with tempfile.TemporaryDirectory() as folder:
            table = study.run(Path(folder) / "out", devices=["cpu"])
        taken = time.process_time() - begun
        low, high = table["trapped_low"], table["trapped_high"]
        wide = float((0.5 * (high - low)).where((low <= 0.5) & (high >= 0.5)).max())
        count = int(table["trials"].sum())
        rows.append((f"{powers} × {starts}, ± {half_width:g}, {name}", f"{count:,}", f"{taken:.3g}", f"{wide:.3f}"))
    return rows


def tables() -> list[Table]:
    """All of them."""
    sizes = ", ".join(f"{n} maps of {a} × {b}" for (a, b), n in MAPS.items())
    known = Table(
        title="Trials for a contour P = ½, of maps whose truth is known",
        head=(
            "map, half-width, rule",
            "trials",
            "times fewer than everywhere",
            "error of the contour [% of the side]",
            "times fewer than everywhere, at that error",
            "widest interval that holds ½, ±",
            "intervals that hold the truth [%]",
        ),
        rows=[row for shape in MAPS for row in known_rows(shape)],
        note=f"Means of {sizes}; P falls from 0.9 to 0.1 over {100.0 * 4.4 * WIDTH:.0f} % of the side.",
    )
    real = Table(
        title="The same of a bead in a tabulated trap, held for 1 s",
        head=("map, half-width, rule", "trials", "processor time [s]", "widest interval that holds ½, ±"),
        rows=[row for shape in REAL for row in real_rows(shape)],
        note=f"On {Machine.look(pick_device('cpu')).text()}; kernels compiled before, stores written.",
    )
    return [known, real]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Trials spent where a contour may be, beside as many everywhere.")
    parser.add_argument("--write", action="store_true", help="write docs/benchmarks/study.md")
    given = parser.parse_args()
    head = f"`python -m benchmarks.adaptive`, seeds fixed. Commit {commit()}."
    text = "\n".join([head, "", *(table.markdown() for table in tables())]).rstrip()
    print(text)
    if given.write:
        save_page(PAGE, put_on_page(PAGE.read_text(encoding="utf-8"), text, BEGIN, END))


if __name__ == "__main__":
    run(main)
