"""`python -m benchmarks.operator_study [--only sobol] [--write]`: what SIMULATED operators do at the cell delivery.

With and without haptics and with the arm alone; over the force gain; and which of their parameters matter (the Sobol
indices, for which a GPU has rows enough). Results are kept in out/operator_study, where it goes on if it was
interrupted. `--write` puts the tables between the markers of docs/operators.md, and the picture into docs/images.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from benchmarks.report import commit, positive, run, save_page
from benchmarks.validation import put_on_page
from otwarp.bench.machine import Machine
from otwarp.device import pick_device
from otwarp.operators import statistics
from otwarp.operators.figure import draw
from otwarp.operators.folder import Folder, run_study
from otwarp.operators.study import OperatorStudy
from otwarp.operators.summary import FELT, MEASURES, summarise
from otwarp.operators.tables import comparison_lines, ends, sobol_lines
from otwarp.operators.task import REACHED
from otwarp.scene import Scene

ROOT = Path(__file__).parents[1]
PAGE, PICTURE = ROOT / "docs" / "operators.md", ROOT / "docs" / "images" / "operators.png"
PARTS = {
    "trials": ("<!-- begin operators -->", "<!-- end operators -->"),
    "sobol": ("<!-- begin sobol -->", "<!-- end sobol -->"),
}
"""What is computed, with its markers on the page: conditions and scans, and the indices."""
ROWS = {"cpu": 16, "cuda": 512}
"""Rows of Saltelli's points: in minutes on a core, and on a GPU, where all are trials at once."""
AT_ONCE = 16_384
"""Operators at once on a GPU."""
SHOWN_INDICES = 4
"""Parameters of which indices are shown, for each number."""
OUT = ROOT / "out" / "operator_study"
PRESSED = (0.25, 0.5, 0.75, 1.0, 1.5)
"""Micrometres that hands aim farther towards the cell than the author's path, in another scan."""
GAINS = (0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1)
"""Force gains of the scan [N/pN]; that of the chain is 0.05."""
SHOWN = ("contact_mean", "contact_peak", "contact_above", "distance_mean", "distance_peak", "force_mean", "force_peak",
         "work_peak", "waited", "slowed", "progress")  # fmt: skip
"""Numbers of the first table."""
SEED = 1


def study(**asked: Any) -> OperatorStudy:
    """Simulated operators at the shipped delivery."""
    return OperatorStudy(scene=Scene.load(ROOT / "scenes" / "cell_delivery.usda"), seed=SEED, **asked)


def computed(name: str, asked: OperatorStudy, device: str) -> Folder:
    """A study, run or gone on with."""

    def say(done: int, count: int) -> None:
        """Tell how far it is."""
        print(f"{name}: chunk {done} of {count}", flush=True)

    return run_study(asked, OUT / name, device=device, progress=say)


def conditions_table(found: dict[str, Any]) -> str:
    """What happened under each condition."""
    names = list(found["success"])
    count = found["operators"]
    lines = [f"| {count:,} simulated operators | {' | '.join(names)} |", f"|---|{'---:|' * len(names)}"]
    rates = (ends(found["success"][name], ".3f") for name in names)
    lines.append(f"| delivered, with 95 % interval | {' | '.join(rates)} |")
    for said in next(iter(found["outcomes"].values())):
        counts = [found["outcomes"][name][said] for name in names]
        if any(counts):
            lines.append(f"| {said} | {' | '.join(map(str, counts))} |")
    for key in SHOWN:
        meaning, unit = {**MEASURES, **FELT}[key]
        rows = [found["numbers"][name][key] for name in names]
        cells = [f"{row['mean']:.3g} ± {row['deviation']:.2g}" for row in rows]
        lines.append(f"| {meaning} [{unit}] | {' | '.join(cells)} |")
    return "\n".join(lines)


def gains_table(main: Folder, operators: int, device: str) -> str:
    """Deliveries and contact force over the force gain, of the same operators."""
    base = main.read()
    without = main.asked()["conditions"].index("without")
    before = base["outcome"][without, :operators] == REACHED
    lines = [
        f"| force gain [N/pN] | delivered of {operators} | with − without | mean contact force [pN] | "
        "peak force on a hand [N] |",
        "|---:|---:|---:|---:|---:|",
        f"| 0 | {ends(vars(statistics.rate(before)), '.3f')} | 0 | "
        f"{base['contact_mean'][without, :operators].mean():.3g} | 0 |",
    ]
    for gain in GAINS:
        found = computed(f"gain_{gain:g}", study(operators=operators, force_gain=gain, conditions=("with",)), device)
        arrays = found.read()
        made = arrays["outcome"][0] == REACHED
        rate, difference = statistics.rate(made), statistics.risk_difference(made, before)
        lines.append(
            f"| {gain:g} | {ends(vars(rate), '.3f')} | {ends(vars(difference), '+.3f')} | "
            f"{arrays['contact_mean'][0].mean():.3g} | {arrays['force_peak'][0].mean():.2g} |"
        )
    return "\n".join(lines)


def pressed_table(main: Folder, operators: int, device: str) -> str:
    """Deliveries and contact force by how far the hands press, of the same operators with and without haptics."""
    lines = [
        f"| farther in by [µm] | delivered of {operators} without | with | with − without | "
        "mean contact force without, with [pN] |",
        "|---:|---:|---:|---:|---:|",
    ]
    for press in (0.0, *PRESSED):
        asked = study(operators=operators, press=press)
        found = computed(f"press_{press:g}", asked, device) if press else main
        arrays = found.read()
        made = arrays["outcome"][:2, :operators] == REACHED
        rates = [ends(vars(statistics.rate(row)), ".3f") for row in made]
        difference = ends(vars(statistics.risk_difference(made[1], made[0])), "+.3f")
        contact = arrays["contact_mean"][:2, :operators].mean(axis=1)
        lines.append(f"| {press:g} | {rates[0]} | {rates[1]} | {difference} | {contact[0]:.3g}, {contact[1]:.3g} |")
    return "\n".join(lines)


def brief(lines: list[str]) -> list[str]:
    """Lines of a comparison: measures of haptics against none, of the other comparisons success alone."""
    out, full = [], True
    for line in lines:
        if line.startswith("success"):
            full = line.startswith("success, with − without")
        if full or not line.startswith("  "):
            out.append(line)
    return out


def trials(device: str, operators: int, scanned: int) -> str:
    """Tables of the conditions and of both scans."""
    main = computed("main", study(operators=operators, conditions=("without", "with", "no response")), device)
    found = summarise(main)
    parts = [
        f"{found['operators']:,} simulated operators, seed {SEED}, population {found['population sha256'][:12]}, "
        f"motion gain {found['motion gain']:.0f} µm/m, force gain {found['force gain']:g} N/pN; mean ± deviation:",
        conditions_table(found),
        "\n".join(f"- {line.strip()}" for line in brief(comparison_lines(found))),
        f"The first {scanned} of them over the force gain:",
        gains_table(main, scanned, device),
        "The same over how much farther towards the cell every hand aims, with haptics and without (asked after the "
        "first table was known):",
        pressed_table(main, scanned, device),
    ]
    return "\n\n".join(parts)


def sobol_text(device: str, rows: int) -> str:
    """The largest Sobol indices, with how many rows they are of, where, and their standard errors."""
    gpu = not pick_device(device).is_cpu
    asked = study(sobol=rows, chunk=AT_ONCE) if gpu else study(sobol=rows)
    found = summarise(computed(f"sobol_{rows}", asked, device))
    code = f" Commit {known}." if (known := commit()) else ""
    return "\n\n".join(
        [
            f"Sobol indices of {found['sobol']['rows']} rows of Saltelli's points, {found['operators']:,} simulated "
            f"operators with haptics and without, the {SHOWN_INDICES} parameters with the largest total index for each "
            "number; ± standard errors, by resampling rows; an index within two of them of 0 tells nothing. "
            f"`python -m benchmarks.operator_study --only sobol` on {Machine.look(pick_device(device)).text()}.{code}",
            "\n".join(f"- {line}" for line in sobol_lines(found, most=SHOWN_INDICES)),
        ]
    )


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="What simulated operators do at the shipped cell delivery.")
    parser.add_argument("--device", default="cpu", help="cpu (default) or cuda:0")
    parser.add_argument("--only", choices=PARTS, help="one part of the page; default: both")
    parser.add_argument("--operators", type=positive, default=400, help="of the first table (default: 400)")
    parser.add_argument("--scanned", type=positive, default=96, help="of the scan of force gains (default: 96)")
    parser.add_argument("--rows", type=positive, help="of Saltelli's points, a power of 2, 2 or more (default: "
                        f"{ROWS['cpu']} on a CPU, {ROWS['cuda']} on a GPU)")  # fmt: skip
    parser.add_argument("--write", action="store_true", help="write docs/operators.md and docs/images/operators.png")
    given = parser.parse_args()
    rows = given.rows or ROWS["cpu" if pick_device(given.device).is_cpu else "cuda"]
    ways = {
        "trials": lambda: trials(given.device, given.operators, min(given.scanned, given.operators)),
        "sobol": lambda: sobol_text(given.device, rows),
    }
    for name in [given.only] if given.only else PARTS:
        text = ways[name]()
        print(text)
        if name == "trials":
            draw(Folder(OUT / "main"), PICTURE if given.write else OUT.with_suffix(".png"))
        if given.write:
            save_page(PAGE, put_on_page(PAGE.read_text(encoding="utf-8"), text, *PARTS[name]))


if __name__ == "__main__":
    run(main)
