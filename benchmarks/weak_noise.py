"""`python -m benchmarks.weak_noise [--write]`: what three-point and uniform noise cost in accuracy.

The chain of each integrator in a one-dimensional well is solved as an operator, so the figures have no sampling noise
and do not depend on the machine; `--write` puts them between the markers of docs/validation/weak_noise.md.
"""

from __future__ import annotations

import argparse
import functools
import math

from benchmarks.report import check_places, run, save_page
from benchmarks.transitions import Chain, SineWell
from benchmarks.validation import PAGES, put_on_page
from otwarp.kernels.core.noise import NOISES
from otwarp.kernels.integrate.integrators import INTEGRATORS

PAGE = PAGES / "weak_noise.md"
BEGIN, END = "<!-- begin weak noise -->", "<!-- end weak noise -->"
DIVISIONS = (5, 10, 20, 40)
"""1/h, h = k·dt/γ; whole numbers, so that a relaxation time is a number of steps."""

HELD, TOP, SLOPE = SineWell(20.0), SineWell(5.0), SineWell(8.0, share=0.6)
HEAD = ("integrator", "noise", "h", "⟨x²⟩", "⟨x(0)x(t)⟩/⟨x²⟩", "escape over a top", "escape off a slope")
NOTE = (
    "Errors in per cent against the Smoluchowski equation. h is the time step over γ/k. ⟨x²⟩ and the correlation after"
    f" one relaxation time γ/k are those in a well of {HELD.depth:g} k_B T, U = (depth/2)(1 − cos x/w); mean escape"
    f" times are those from the bottom of one of {TOP.depth:g} k_B T to where its force vanishes, and of one that ends"
    f" at {SLOPE.energy(SLOPE.rim):.1f} k_B T, where its force is near its largest. Escapes under leimkuhlerMatthews"
    " are not of this chain."
)


@functools.cache
def exact(well: SineWell) -> tuple[float, float, float]:
    """⟨x²⟩, its correlation and the escape time; where a bead is held, or where it leaves."""
    if well is HELD:
        return well.variance(), well.correlation(1.0), math.nan
    return math.nan, math.nan, well.escape_time()


def row(integrator: str, noise: str, divisions: int) -> tuple[str, ...]:
    """Cells of one chain."""
    step = 1.0 / divisions
    held = Chain(integrator, noise, HELD, step)
    cells = [
        held.variance() / exact(HELD)[0] - 1.0,
        held.correlation(divisions) / exact(HELD)[1] - 1.0,
    ]
    if integrator != "leimkuhlerMatthews":
        cells += [Chain(integrator, noise, well, step).escape_time() / exact(well)[2] - 1.0 for well in (TOP, SLOPE)]
    texts = [f"{100.0 * cell:+.3f}" for cell in cells] + ["–"] * (4 - len(cells))
    return integrator, noise, f"{step:g}", *texts


def markdown() -> str:
    """The table and what it holds."""
    lines = [f"`python -m benchmarks.weak_noise`. {NOTE}", "", "| " + " | ".join(HEAD) + " |"]
    lines.append("|---|---" + "|---:" * (len(HEAD) - 2) + "|")
    lines += [
        "| " + " | ".join(row(integrator, noise, divisions)) + " |"
        for integrator in INTEGRATORS
        for noise in NOISES
        for divisions in DIVISIONS
    ]
    return "\n".join(lines)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="What cheaper noise costs in accuracy.")
    parser.add_argument("--write", action="store_true", help="rewrite the table of docs/validation/weak_noise.md")
    arguments = parser.parse_args()
    check_places(None, (PAGE,) if arguments.write else ())
    text = markdown()
    print(text)
    if arguments.write:
        save_page(PAGE, put_on_page(PAGE.read_text(encoding="utf-8"), text, BEGIN, END))


if __name__ == "__main__":
    run(main)
