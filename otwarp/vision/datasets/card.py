"""The data card: what a data set holds and what it does not, for people."""

from __future__ import annotations

import numpy as np

from otwarp.files import written
from otwarp.vision.datasets.domain import PARAMETERS
from otwarp.vision.datasets.labels import Labels
from otwarp.vision.datasets.splits import PARTS
from otwarp.vision.datasets.store import Store, label_attributes

SAID = {
    "random": "at random within classes, as is usual: what tests has neighbours of its focus sweep that train",
    "focus_blocks": "whole blocks of the focus sweep",
    "unseen_tilts": "tests on tilts that do not train",
    "unseen_robots": "tests on robots that neither train nor validate",
}


def write_card(labels: Labels, store: Store) -> None:
    """Write `README.md` of a dataset: what its images show, how they were made, how to read them."""
    spec, m = labels.spec, labels.spec.microscope
    robot = spec.robot.name or "a robot of the file"
    size = f"{spec.width} × {spec.height}"
    lines = [
        f"# {labels.count} images of {robot}",
        "",
        "![Some of the images](samples.png)",
        "",
        f"Synthetic images of a transparent microrobot, {size} pixels of {1e3 * m.pixel:.4g} nm, computed by "
        "otwarp from waves that pass the robot and the microscope. Labels are exact: they are what was rendered.",
        "",
        f"- **Robot**: {len(spec.robot.radius)} solids, {spec.robots} of the class; symmetry "
        f"{_symmetry(spec.robot.symmetry())}.",
        f"- **Poses**: {labels.poses}; {len(spec.classes)} classes of tilt from {spec.classes[0]:g} to "
        f"{spec.classes[-1]:g}°, {spec.between} tilts of no class in every gap, {spec.poses} of each.",
        f"- **Depth**: {spec.depth[0]:g} to {spec.depth[1]:g} µm, {spec.count} focal positions a pose.",
        f"- **Optics**: NA {m.numerical_aperture:g}, condenser {m.condenser_aperture:g}, {1e3 * m.wavelength:g} nm, "
        f"medium {m.medium_index:g}; method {spec.rendering.method}, slices of {spec.rendering.thickness:g} µm.",
        f"- **Sensor**: {spec.sensor.bits} bits, {spec.sensor.electrons:g} electrons, noise {spec.sensor.noise:g}.",
        f"- **Seed**: {spec.seed}.",
        "",
        "| varies | drawn for every | from | to | unit |",
        "|---|---|---:|---:|---|",
        *(f"| {name} | {PARAMETERS[name].scope} | {r.low:g} | {r.high:g} | {PARAMETERS[name].units} |"
          for name, r in spec.domain.items()),
        "",
        "| label | unit | meaning |",
        "|---|---|---|",
        *(f"| {name} | {label_attributes(name)[0]} | {label_attributes(name)[1]} |" for name in labels.arrays),
        "",
        "| split | train | validation | test | how |",
        "|---|---:|---:|---:|---|",
        *(_split(name, labels.arrays[f"split_{name}"]) for name in spec.splits),
        "",
        "What the images lack: obstacles and walls, light that solids throw back and forth (but by the method mie), "
        "polarisation of the source, dirt, drift and vibration. Row 0 of an image is the lowest.",
        "",
        "Read it with `otwarp.vision.datasets.open_dataset`, or any program that reads zarr; `checksums.json` has the "
        "SHA-256 of every file of `data.zarr`.",
        "",
    ]  # fmt: skip
    with written(store.folder / "README.md") as part:
        part.write_text("\n".join(lines), encoding="utf-8")


def _symmetry(found: dict[str, object]) -> str:
    if found["spherical"]:
        return "of a sphere"
    words = ["about its long axis by any angle"] if found["axial"] else []
    if found["order"] != 1:
        words.append(f"about its long axis by 1/{found['order']} of a turn")
    if found["flip"]:
        words.append("a half turn that reverses it")
    return ", ".join(words) or "none"


def _split(name: str, part: np.ndarray) -> str:
    counts = " | ".join(str(int(np.sum(part == n))) for n in range(len(PARTS)))
    return f"| {name} | {counts} | {SAID[name]} |"
