"""A network in use: optics that it has not learnt, one at a time, and the time of an image of 128 × 128 pixels."""

from __future__ import annotations

import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.report import Section, command
from benchmarks.vision_networks import SPECS, run_times, small_spec
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.device import pick_device
from otwarp.errors import PlausibilityWarning
from otwarp.vision.datasets import labels_of, load_spec, make_dataset, open_dataset
from otwarp.vision.networks.baselines import BASELINES, Shown
from otwarp.vision.networks.evaluate import evaluate
from otwarp.vision.networks.metrics import scores_of
from otwarp.vision.networks.settings import Settings
from otwarp.vision.networks.train import train
from otwarp.vision.networks.use import load

TRAINING: dict[str, Any] = {"net": "small", "epochs": 20, "batch": 8, "lr": 3e-3}

SHIFTS: dict[str, dict[str, str]] = {
    "as learnt, other depths and places": {},
    "wavelength 0.55 → 0.60 µm": {"wavelength": "{ values = [0.60] }"},
    "objective 1.0 → 0.9": {"numerical_aperture": "{ values = [0.9] }"},
    "condenser 0.2 → 0.35": {"condenser_aperture": "{ values = [0.35] }"},
    "condenser 0.1 off the axis": {"condenser_x": "{ values = [0.1] }"},
    "condenser out of focus, 0.004/µm": {"illumination_curvature": "{ values = [0.004] }"},
    "robot's index 1.52 → 1.55": {"index": "{ values = [1.55] }"},
    "liquid's index 1.33 → 1.345": {"medium_index": "{ values = [1.345] }"},
    "robot 5 % larger": {"radius_scale": "{ values = [1.05] }", "length_scale": "{ values = [1.05] }"},
    "coma of 0.1 wavelengths": {"coma": "{ values = [0.1] }"},
    "spherical aberration of 0.1 wavelengths": {"spherical": "{ values = [0.1] }"},
    "a tenth of the photons": {"electrons": "{ values = [1000.0] }"},
}
"""What differs → entries of [domain]."""

RANDOMISED = {
    "wavelength": "{ from = 0.52, to = 0.62 }",
    "condenser_aperture": "{ from = 0.15, to = 0.4 }",
    "condenser_x": "{ from = -0.12, to = 0.12 }",
    "illumination_curvature": "{ from = -0.005, to = 0.005 }",
    "medium_index": "{ from = 1.325, to = 1.35 }",
    "numerical_aperture": "{ from = 0.85, to = 1.05 }",
    "coma": "{ from = -0.12, to = 0.12 }",
    "spherical": "{ from = -0.12, to = 0.12 }",
    "electrons": "{ from = 1000.0, to = 20000.0 }",
}
"""Of the second network's data set: its robots are those of the first."""


def changed(folder: Path, name: str, domain: dict[str, str], **depth: str) -> Path:
    """The data set of `vision_networks`' small runs with more in its domain, and other depths."""
    text = small_spec(folder).read_text(encoding="utf-8")
    text = text.replace("[domain]\n", "[domain]\n" + "".join(f"{k} = {v}\n" for k, v in domain.items()))
    text = text.replace("count = 40\n", "".join(f"{k} = {v}\n" for k, v in depth.items()) or "count = 40\n")
    if depth:
        text = text[: text.index("[splits]")].replace("seed = 7", "seed = 8")
    (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    return folder / f"{name}.toml"


def rendered(folder: Path, spec: Path, device: str) -> Path:
    """The data set of a file."""
    return make_dataset(labels_of(load_spec(spec)), folder / spec.stem, processes=1, device=device)


def shifts(work: Path, device: str, data: dict[str, Any]) -> Table:
    """Two networks, of fixed and of varied optics, and the nearest template, on images that differ in one thing."""
    runs, rows = {}, []
    for name, domain, poses in (("fixed", {}, ""), ("varied", RANDOMISED, "poses = 4\n")):
        spec = changed(work, f"learn_{name}", domain)
        if poses:  # as many images, of more poses, for which optics are drawn
            text = spec.read_text(encoding="utf-8").replace("seed = 7\n", f"seed = 7\n{poses}")
            text = text.replace("count = 40\n", "count = 10\n").replace("focus_blocks = ", "# focus_blocks = ")
            spec.write_text(text, encoding="utf-8")
        train(rendered(work, spec, device), work / name, Settings(**TRAINING, split="random"), device=device)
        runs[name] = work / name
    own, targets = open_dataset(work / "learn_fixed"), load(runs["fixed"], device=device).targets
    shown = Shown.of(own, own.split("random")["train"], targets)
    for n, (name, domain) in enumerate(SHIFTS.items()):
        place = rendered(work, changed(work, f"shift_{n}", domain, count="8", scattered="true"), device)
        found = open_dataset(place)
        said = BASELINES["nearest template"](shown, found.images(slice(None)), len(targets.classes))
        template = scores_of(said, targets, found.labels, np.arange(found.count))
        cells = []
        for run in runs.values():
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", PlausibilityWarning)  # that optics are others is the point
                _, (one,) = evaluate(run, [place], poses=0, baselines=False, device=device, any_robot=True)
            data[f"{name}, {run.name}"] = one.said()
            rmse, inside = one.scores["rmse"], one.scores["coverage"]["95"]
            cells += [f"{rmse['depth']:.2f}", f"{rmse['tilt']:.1f}", f"{100 * inside['depth']:.0f} %"]
        data[f"{name}, nearest template"] = template
        rows.append((name, *cells, f"{template['rmse']['depth']:.2f}", f"{template['rmse']['tilt']:.1f}"))
    head = ("what differs", "fixed optics: depth [µm]", "tilt [°]", "depth within 95 %", "varied optics: depth [µm]",
            "tilt [°]", "depth within 95 %", "nearest template: depth [µm]", "tilt [°]")  # fmt: skip
    note = (f"Root mean square errors of {found.count} images of 64 × 64 pixels each, ten tilts, random depths; small "
            "networks that learnt from 260 images, one seed; nearest of the images of fixed optics.")  # fmt: skip
    return Table(title="Errors on optics and robots that differ from those learnt", head=head, rows=rows, note=note)


def large_images(work: Path, device: str, data: dict[str, Any]) -> Table:
    """Run times of networks that look at 128 × 128 pixels."""
    text = (SPECS / "smoke.toml").read_text(encoding="utf-8").replace("width = 64", "width = 128")
    text = text.replace("count = 5 }", "count = 2 }").replace("count = 40", "count = 12")
    text = text[: text.index("[splits]")] + "[splits]\nrandom = [8, 2, 2]\n"
    (work / "large.toml").write_text(text, encoding="utf-8")
    place, runs = rendered(work, work / "large.toml", device), {}
    for net in ("small", "resnet18"):
        how = Settings(net=net, epochs=1, batch=8, split="random")
        train(place, work / f"large_{net}", how, device=device)
        runs[f"{net}, 128 px"] = work / f"large_{net}"
    return run_times(work, runs, device, data)


def measure(device: str = "cpu", *, rounds: int = 1) -> Section:
    """Both tables; seeds are fixed, so that `rounds` changes nothing."""
    place = pick_device(device)
    with tempfile.TemporaryDirectory() as apart:
        work, data = Path(apart), dict[str, Any]()
        tables = [shifts(work, device, data), large_images(work, device, data)]
    kind = "cpu" if place.is_cpu else "cuda"
    return Section(name="vision_shifted", kind=kind, machine=Machine.look(place), tables=tables, data=data)


if __name__ == "__main__":
    command(measure, "A network in use.", rounds=1)
