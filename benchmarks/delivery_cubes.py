"""`python -m benchmarks.delivery_cubes [--write]`: why the shipped cell delivery fails at some speeds between others.

The trials of two points that fail and of their neighbours that do not, with more of them, with half the time step, and
without the cube that they meet. `--write` puts the table between the markers of docs/studies_shipped.md.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import otwarp as ot
from benchmarks.report import run, save_page
from benchmarks.validation import put_on_page
from otwarp.studies import delivered, first_lost, place
from otwarp.studies.quantity import quantity

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "studies_shipped.md"
BEGIN, END = "<!-- begin delivery -->", "<!-- end delivery -->"
SCENE = ROOT / "scenes" / "cell_delivery.usda"
SPEEDS = (19.0, 25.0, 32.0, 40.0)
"""Highest speeds of the robots [µm/s]."""
POWER, STIFFNESS, STEP, TRIALS = 7.2, 1.0, quantity("0.5 ms", "s", "step"), 16
"""Trap power [mW], Young's modulus of the cell [kPa], the study's time step [s], and trials of a point."""
CUBE = "cube_2"


def without(cube: str, folder: Path) -> Path:
    """A scene like the shipped one, but for a cube: a file in a folder."""
    text = SCENE.read_text(encoding="utf-8")
    head = text[: text.index("\n)\n")]
    over = f'over "World"\n{{\nover "Obstacles"\n{{\nover "{cube}" (\nactive = false\n)\n{{\n}}\n}}\n}}\n'
    file = folder / "without.usda"
    file.write_text(f"{head}\n    subLayers = [@{SCENE}@]\n)\n{over}", encoding="utf-8")
    return file


def trials(scene: Path, step: float) -> Any:
    """What became of the trials at all speeds."""
    study = ot.Study(
        scene,
        axes={
            "trap_power": ot.values([POWER], unit="mW"),
            "/World/cell.ot:cell:youngsModulus": ot.values([STIFFNESS], unit="kPa"),
            "speed:/World/Traps/left_hub": ot.values(SPEEDS, unit="µm/s"),
        },
        observables=[delivered(until=14.0), first_lost(), place(along="x"), place(along="y"), ot.first_passage()],
        stop=ot.trials(TRIALS),
        seed=11,
        time_step=step,
    )
    with tempfile.TemporaryDirectory() as folder:
        return study.run(Path(folder) / "out").squeeze()


def rows() -> str:
    """The table."""
    with tempfile.TemporaryDirectory() as folder:
        found = [trials(SCENE, STEP), trials(SCENE, 0.5 * STEP), trials(without(CUBE, Path(folder)), STEP)]
    text = [
        f"| speed [µm/s] | delivered | with half the step | without {CUBE} | lost first, where the cell is [µm] |",
        "|---:|---:|---:|---:|---|",
    ]
    shares = [str(name) for name in found[0] if str(name).startswith("first_lost_") and str(name).endswith("_count")]
    for n, speed in enumerate(SPEEDS):
        counts = " | ".join(f"{int(one['delivered_count'][n])}" for one in found)
        base = found[0].isel(speed_left_hub=n)
        which = {name[len("first_lost_") : -len("_count")]: int(base[name]) for name in shares if int(base[name])}
        said = ", ".join(f"{name} {count} times" for name, count in which.items())
        where = f" at ({float(base['place_x']):.0f}, {float(base['place_y']):.0f})" if which else ""
        text.append(f"| {speed:g} | {counts} | {said}{where} |")
    about = f"Of {TRIALS} trials each at {POWER:g} mW and {STIFFNESS:g} kPa."
    return "\n".join([*text, "", about])


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Why the shipped cell delivery fails at some speeds between others.")
    parser.add_argument("--write", action="store_true", help="write docs/studies_shipped.md")
    given = parser.parse_args()
    text = rows()
    print(text)
    if given.write:
        save_page(PAGE, put_on_page(PAGE.read_text(encoding="utf-8"), text, BEGIN, END))


if __name__ == "__main__":
    run(main)
