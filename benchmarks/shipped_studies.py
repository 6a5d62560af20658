"""`python -m benchmarks.shipped_studies [NAME …] [--write]`: run the shipped studies and draw their pictures.

Results are kept in out/, where a study goes on that was interrupted. `--write` puts pictures into docs/images, and the
table of speeds, beside what the equation of drag says, between the markers of docs/studies_shipped.md.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

import otwarp as ot
from benchmarks.report import run, save_page
from benchmarks.validation import put_on_page
from otwarp.files import save_picture
from otwarp.optics import Particle, force, trap_properties
from otwarp.simulation.packing.optics import beam_of
from otwarp.studies import Store, load_study, open_store, table
from otwarp.studies.figure import COLORS, draw
from otwarp.studies.results import choices_of, taken

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "studies_shipped.md"
BEGIN, END = "<!-- begin transport -->", "<!-- end transport -->"
DRAWN = {
    "capture": "trapped",
    "robot_hold": "first_lost",
    "delivery": "outcome",
    "escape": "escape_rate",
    "transport": "",
}
"""Study, and what of it is drawn; that of transport stands beside the equation of drag."""
WEAK = 0.36
"""Trap power of the survival curves [mW]."""


def drag_limits(scene: ot.Scene) -> tuple[float, float]:
    """Speeds per power at which drag exceeds what the first trap holds its sphere with, without noise [µm/s/mW].

    Returns:
        By the largest force straight across the beam at the height of equilibrium, and by the largest force across at
        heights where no force is left along the beam: drag lifts the sphere out of the focus before it is lost.
    """
    beam, sphere = beam_of(scene.traps[0], scene.medium), scene.bodies[0].spheres[0]
    particle = Particle(radius=sphere.radius, index=sphere.refractive_index)
    known = trap_properties(beam, particle)
    across, up = np.linspace(0.0, 2.0 * sphere.radius, 101), np.linspace(-0.5, 2.5, 301) * sphere.radius
    points = np.stack(np.broadcast_arrays(across[:, None], 0.0, known.equilibrium + up), axis=-1)
    forces = force(beam, particle, points.reshape(-1, 3)).reshape(points.shape) * beam.force_scale
    height, most = known.equilibrium, 0.0
    for n in range(len(across)):
        z, axial = points[n, :, 2], forces[n, :, 2]
        falls = np.flatnonzero((axial[:-1] > 0.0) & (axial[1:] <= 0.0))
        roots = z[falls] + (z[falls + 1] - z[falls]) * axial[falls] / (axial[falls] - axial[falls + 1])
        if not len(roots):  # from here on the beam pushes it on
            break
        height = roots[np.argmin(np.abs(roots - height))]
        most = max(most, -float(np.interp(height, z, forces[n, :, 0])))
    drag = 6.0 * np.pi * scene.medium.viscosity * sphere.radius * beam.power
    return known.escape_force[0] / drag, most / drag


def rows(found: Any, limits: tuple[float, float]) -> str:
    """The table of speeds by power."""
    text = [
        "| power [mW] | largest speed [µm/s] | interval [µm/s] | share of the drag limit |",
        "|---:|---:|---:|---:|",
    ]
    for row in found[["largest", "largest_low", "largest_high"]].to_dataframe().reset_index().itertuples():
        share = row.largest / (limits[1] * row.trap_power)
        text.append(
            f"| {row.trap_power:g} | {row.largest:.0f} | {row.largest_low:.0f} – {row.largest_high:.0f} | {share:.2f} |"
        )
    about = (
        f"The equation of drag gives {limits[1]:.1f} µm/s per mW with the height at which no force is left along the "
        f"beam, and {limits[0]:.1f} straight across at the height of rest, out of which drag lifts the sphere."
    )
    return "\n".join([*text, "", about])


def draw_transport(found: Any, limits: tuple[float, float], file: Path) -> None:
    """Largest speed over power, beside the equation of drag."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.6), layout="constrained")
    axes = figure.add_subplot()
    power, speed = found["trap_power"].values, found["largest"].values
    ends = [np.abs(found[f"largest_{end}"].values - speed) for end in ("low", "high")]
    axes.errorbar(power, speed, ends, fmt="o", color=COLORS[0], capsize=3, label="held for 0.2 s in 95 % of trials")
    for limit, style, label in zip(limits, (":", "--"), ("straight across", "free along the beam"), strict=True):
        axes.plot(power, limit * power, style, color=COLORS[5], label=f"largest force over drag, {label}")
    axes.set(xlabel="trap power [mW]", ylabel="largest speed [µm/s]", xscale="log", yscale="log")
    axes.set_xticks(power, [f"{p:g}" for p in power])
    axes.set_yticks([50, 100, 200, 500, 1000], ["50", "100", "200", "500", "1000"])
    axes.minorticks_off()
    axes.legend()
    save_picture(figure, file)


def draw_places(store: Store, file: Path) -> None:
    """Where the cell is at the end of each trial of the delivery, seen from above, by what became of it."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle, Rectangle

    asked, scene = store.asked(), ot.Scene.load(store.scene)
    names = choices_of(asked, next(o for o in asked["observables"] if o["name"] == "outcome"))
    figure = Figure(figsize=(8.4, 4.4), layout="constrained")
    axes = figure.add_subplot()
    for o in scene.obstacles:
        (x, y, _), size = o.position.at(0.0), o.size
        if o.shape == "cylinder":
            axes.add_patch(Circle((x, y), size[0], color="0.75"))
        elif o.shape == "box":
            box = (x - size[0], y - size[1]), 2.0 * size[0], 2.0 * size[1]
            axes.add_patch(Rectangle(*box, color="0.75" if not o.position.animated else "0.9"))
    with store.read() as raw:
        x, y, end = (raw[n].values for n in ("place_x_of_trial", "place_y_of_trial", "end"))
        there = taken(raw)
    for n, name in enumerate(names):
        mine = there & (end == (n + 1) % len(names))
        if not mine.any():
            continue
        label = f"{name.replace('_', ' ')}: {mine.sum()} trials"
        axes.plot(x[mine], y[mine], "o", color=COLORS[n], markersize=3, alpha=0.5, label=label)
    axes.set(xlabel="x [µm]", ylabel="y [µm]", aspect="equal", xlim=(-83, 83), ylim=(-44, 44))
    axes.legend(fontsize=8, loc="lower right")
    save_picture(figure, file)


def compute(name: str, *, write: bool) -> None:
    """Run one study, and draw it into docs/images or its folder."""
    folder = ROOT / "out" / name
    load_study(ROOT / "studies" / f"{name}.toml").run(folder)
    store = open_store(folder)
    picture = (ROOT / "docs" / "images" if write else folder.parent) / f"study_{name}.png"
    if name != "transport":
        print(draw(store, picture, name=DRAWN[name]))
        beside = {n: picture.with_name(f"study_{name}_{n}.png") for n in ("success", "places", "survival")}
        if name == "delivery":
            print(draw(store, beside["success"], name="delivered"))
            draw_places(store, beside["places"])
        if name == "capture":
            print(draw(store, beside["survival"], name="first_passage", survival=True, at={"trap_power": WEAK}))
        return
    found, limits = table(store), drag_limits(ot.Scene.load(ROOT / "scenes" / "transport.usda"))
    draw_transport(found, limits, picture)
    print(picture, rows(found, limits), sep="\n")
    if write:
        save_page(PAGE, put_on_page(PAGE.read_text(encoding="utf-8"), rows(found, limits), BEGIN, END))


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Run the shipped studies and draw their pictures.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"some of {', '.join(DRAWN)}; default: all")
    parser.add_argument("--write", action="store_true", help="write docs/images and docs/studies_shipped.md")
    given = parser.parse_args()
    wrong = [name for name in given.names if name not in DRAWN]
    if wrong:
        raise ot.InputError(f"NAME is {wrong[0]}; allowed: {', '.join(DRAWN)}")
    for name in given.names or DRAWN:
        compute(name, write=given.write)


if __name__ == "__main__":
    run(main)
