"""Networks on images of robots: splits that leak and splits that do not, photons, images needed, bounds, run times."""

from __future__ import annotations

import dataclasses
import importlib.util
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.report import Section, command
from benchmarks.vision_tables import ERRORS, bounds_by_pose, cells, confusion_by_tilt, many_robots, unseen
from benchmarks.vision_training import NETS, training_speed
from benchmarks.vision_trainings import SPLITS, all_trainings, at_once, of_losses, of_robots, of_shares, of_split
from otwarp.bench.machine import Machine
from otwarp.bench.report import NOTHING, Table
from otwarp.device import pick_device
from otwarp.vision.datasets import labels_of, load_spec, make_dataset, open_dataset
from otwarp.vision.datasets.shots import pose_intensities
from otwarp.vision.fourier import Fourier
from otwarp.vision.networks.baselines import BASELINES, Shown
from otwarp.vision.networks.bound import bound, fisher_information, labels_from, views
from otwarp.vision.networks.evaluate import evaluate
from otwarp.vision.networks.metrics import scores_of
from otwarp.vision.networks.onnx_file import export
from otwarp.vision.networks.run import Estimator
from otwarp.vision.networks.settings import Settings
from otwarp.vision.networks.train import train
from otwarp.vision.networks.use import load

SPECS = Path(__file__).resolve().parent.parent / "vision"
ELECTRONS = (300.0, 1000.0, 10000.0, 100000.0)

SMALL: dict[str, dict[str, Any]] = {
    "small": {"net": "small", "epochs": 20, "batch": 8, "lr": 3e-3},
    "resnet18": {"net": "resnet18", "epochs": 8, "batch": 16},
}
FULL: dict[str, dict[str, Any]] = {
    **{net: {"net": net, "heads": "paper", "schedule": "step", "epochs": 20, "batch": 32, "augment": False}
       for net in ("vgg16", "resnet18", "resnet50")},
    "resnet18, pose": {"net": "resnet18", "epochs": 20, "batch": 32},
    "small, pose": {"net": "small", "epochs": 20, "batch": 32, "lr": 3e-3},
}  # fmt: skip


def small_spec(folder: Path) -> Path:
    """The robot of `smoke.toml` at ten tilts: 400 images of 64 × 64 pixels."""
    text = (SPECS / "smoke.toml").read_text(encoding="utf-8").replace("count = 5 }", "count = 10 }")
    (folder / "networks.toml").write_text(text, encoding="utf-8")
    return folder / "networks.toml"


def measure(
    device: str = "cpu",
    *,
    rounds: int = 1,
    full: bool = False,
    folder: Path | None = None,
    devices: Sequence[str] = (),
    speed: bool = False,
    runs: Mapping[str, Any] | None = None,
) -> Section:
    """All tables, or that of the speed of training.

    Args:
        device: cpu or cuda:0.
        rounds: Seeds of every training; of the full table five are meant.
        full: The paper's layout and networks, hours on a GPU, instead of 400 small images.
        folder: Keeps data sets and trainings, which are found again; None for nowhere. One in memory (/dev/shm) saves
            minutes of writing weights.
        devices: On which trainings run at the same time, one for each time that a device is named; none for one after
            the other on `device`.
        speed: Only how fast networks train and look, which takes a few minutes and depends on neither `full` nor
            `folder`.
        runs: Trainings by name, with settings; None for those of this script.
    """
    nets = tuple(dict.fromkeys(how["net"] for how in runs.values())) if runs else NETS
    if speed:
        return speed_alone(device, rounds, nets)
    tables, begun = list[Table](), time.perf_counter()

    def keep(table: Table) -> None:
        tables.append(table)
        print(f"after {time.perf_counter() - begun:.0f} s: {table.title}", file=sys.stderr, flush=True)

    with tempfile.TemporaryDirectory() as apart:
        work = folder or Path(apart)
        work.mkdir(parents=True, exist_ok=True)
        place, spec = work / "data", SPECS / "paper.toml" if full else small_spec(work)
        make_dataset(labels_of(load_spec(spec)), place, processes=1, device=device)
        robots, data = work / "robots", {}
        make_dataset(labels_of(many_robots(load_spec(spec))), robots, processes=1, device=device)
        runs, best = runs or (FULL if full else SMALL), "small, pose" if full else "small"
        if devices:
            others = {f: how for some in of_robots(work, best, runs[best], rounds).values() for f, how in some.items()}
            at_once({place: all_trainings(place, work, runs, best, rounds), robots: others}, devices)
        keep(table_of_splits(place, work, runs, rounds, device, data))
        keep(confusion_by_tilt(place, runs, data))
        if full:
            make_dataset(labels_of(load_spec(SPECS / "shifted.toml")), work / "shifted", processes=1, device=device)
            keep(shifted(work / "shifted", work, runs, device, data))
        keep(unseen(place, robots, work, best, runs[best], rounds, device, data))
        run = work / f"{best}_focus_blocks_0"
        for table in stated(run, place, 5 if full else 4, device, data):
            keep(table)
        keep(photons(run, place, device, data))
        keep(images_needed(place, work, best, runs[best], device, data))
        keep(ablation(place, work, runs, device, data))
        keep(training_speed(place, device, rounds, data, nets=nets))
        there = {n: work / f"{n}_random_0" for n in runs} | of_128_pixels(place, work, device)
        keep(run_times(work, there, device, data))
    return section(device, tables, data, "--full" if full else "", of_rounds(rounds),
                   f"--devices {' '.join(devices)}" if devices else "")  # fmt: skip


def speed_alone(device: str, rounds: int, nets: Sequence[str]) -> Section:
    """How fast networks train, and look at an image: of what they are shown only the number counts."""
    data: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as apart:
        work, place = Path(apart), Path(apart) / "data"
        make_dataset(labels_of(load_spec(SPECS / "smoke.toml")), place, processes=1, device=device)
        tables = [training_speed(place, device, rounds, data, nets=nets)]
        tables.append(run_times(work, of_128_pixels(place, work, device), device, data))
    return section(device, tables, data, "--speed", of_rounds(rounds))


def of_rounds(rounds: int) -> str:
    """As typed; nothing for the usual one."""
    return f"--rounds {rounds}" if rounds > 1 else ""


def section(device: str, tables: list[Table], data: dict[str, Any], *words: str) -> Section:
    """Tables with the options that were typed."""
    kind, asked = "cpu" if pick_device(device).is_cpu else "cuda", " ".join(word for word in words if word)
    machine = Machine.look(pick_device(device))
    return Section(name="vision_networks", kind=kind, machine=machine, tables=tables, data=data, asked=asked)


def table_of_splits(
    place: Path, work: Path, runs: Mapping[str, Any], seeds: int, device: str, data: dict[str, Any]
) -> Table:
    """Every network on both splits, and the baselines."""
    rows, found = [], open_dataset(place)
    for split in SPLITS:
        for name, how in runs.items():
            folders = of_split(work, name, how, split, seeds)
            some = [train(place, folder, settings, device=device) for folder, settings in folders.items()]
            seconds = np.median([s["training_seconds"] for s in some])
            speed = np.median([s["images_per_second"] for s in some])
            rows.append((f"{name}, {split}", *cells([s["test"] for s in some]), f"{seconds:.0f}", f"{speed:.0f}"))
            data[f"{name}, {split}"] = some
        targets, parts = load(work / f"{next(iter(runs))}_{split}_0", device=device).targets, found.split(split)
        if not targets.names:  # of the full table the first network is the paper's
            targets = load(work / f"small, pose_{split}_0", device=device).targets
        shown = Shown.of(found, parts["train"], targets)
        for name, baseline in BASELINES.items():
            said = baseline(shown, found.images(parts["test"]), len(targets.classes))
            scores = scores_of(said, targets, found.labels, parts["test"])
            rows.append((f"{name}, {split}", *cells([scores]), NOTHING, NOTHING))
            data[f"{name}, {split}"] = scores
    head = ("network, split", *ERRORS, "training [s]", "images/s")
    size = f"{found.count} images of {found.shape[1]} × {found.shape[0]} pixels, {len(found.classes)} tilts"
    note = (
        f"{size}; random weights; root mean square errors of the test part; depth in µm by the pose's head, or by the "
    )
    note += "paper's times the sweep; tilt by the pose's head."
    return Table(title="Splits at random and by blocks of focus", head=head, rows=rows, note=note)


def shifted(place: Path, work: Path, runs: Mapping[str, Any], device: str, data: dict[str, Any]) -> Table:
    """Networks on robots of the class that they have not seen, in other light, through an objective that aberrates."""
    rows = []
    for split in SPLITS:
        for name in runs:
            _, (one,) = evaluate(work / f"{name}_{split}_0", [place], poses=0, baselines=False, device=device)
            inside = one.scores.get("coverage", {}).get("95", {}).get("depth")
            rows.append(
                (f"{name}, {split}", *cells([one.scores]), NOTHING if inside is None else f"{100 * inside:.0f} %")
            )
            data[f"shifted {name}, {split}"] = one.said()
    found = open_dataset(place)
    note = f"{found.count} images of `vision/shifted.toml`: what varies there is said in it. One seed."
    head = ("network, trained on", *ERRORS, "depth within 95 %")
    return Table(title="Other optics, other robots", head=head, rows=rows, note=note)


def stated(run: Path, place: Path, poses: int, device: str, data: dict[str, Any]) -> list[Table]:
    """Whether the uncertainty is right, and how far errors are from the Cramér–Rao bound: together, and by pose."""
    _, (one,) = evaluate(run, [place], poses=poses, baselines=False, device=device)
    data["stated"] = one.said()
    rows, tilts = [], len({row["tilt"] for row in one.by_pose})
    for name, value in one.efficiency.items():
        unit = "°" if name in ("tilt", "yaw") else "µm"
        coverage = [f"{100 * one.scores['coverage'][p][name]:.0f} %" for p in ("68", "95")]
        errors = (f"{one.scores[of][name]:.3g}" for of in ("rmse", "sigma"))
        ends = (f"{value['bound']:.2g}", f"{100 * value['efficiency']:.2g} %")
        rows.append((f"{name} [{unit}]", *errors, *coverage, *ends))
    note = f"Small network, blocks of focus; negative log density {one.scores['nll']:.2f} nats; bound of {tilts} tilts."
    head = ("quantity", "error", "stated", "within 68 %", "within 95 %", "Cramér–Rao bound", "bound / error")
    whole = Table(title="Stated uncertainty, and what the images hold", head=head, rows=rows, note=note)
    return [whole, bounds_by_pose(one)]


def photons(run: Path, place: Path, device: str, data: dict[str, Any]) -> Table:
    """Errors of one network, and the bound, over the photoelectrons of full scale: the same light, recorded again."""
    network, found, fourier = load(run, device=device), open_dataset(place), Fourier(device)
    labels, names = labels_from(found), network.targets.names
    test = found.split("focus_blocks")["test"]
    of = labels.arrays["pose"][test]
    light = np.concatenate([pose_intensities(labels, int(p), fourier, test[of == p]) for p in np.unique(of)])
    order = np.concatenate([test[of == p] for p in np.unique(of)])
    middle = int(np.unique(of)[len(np.unique(of)) // 2])
    mine = test[of == middle]
    seen, rows = views(labels, middle, mine, names, fourier), []
    for electrons in ELECTRONS:
        sensors = [dataclasses.replace(labels.sensor(int(r)), electrons=electrons) for r in order]
        levels = np.stack(
            [s.levels(page, seed=7, image=int(r)) for s, page, r in zip(sensors, light, order, strict=True)]
        )
        scores = scores_of(network.predict(levels), network.targets, found.labels, order)
        least = [np.diagonal(bound(fisher_information(i, s, sensors[0])))
                 for i, s in zip(seen.intensity, seen.slopes, strict=True)]  # fmt: skip
        least = np.sqrt(np.mean(least, 0))
        depth, tilt = names.index("depth"), names.index("tilt")
        rows.append((f"{electrons:g}", f"{scores['rmse']['depth']:.3g}", f"{least[depth]:.2g}",
                     f"{scores['rmse']['tilt']:.3g}", f"{np.degrees(least[tilt]):.2g}"))  # fmt: skip
        data[f"photons {electrons:g}"] = {"scores": scores, "bound": least.tolist()}
    head = ("electrons of full scale", "depth [µm]", "its bound", "tilt [°]", "its bound")
    note = "Small network, trained at 10,000, on blocks of focus that it has not seen; the bound is of one pose."
    return Table(title="Errors over photons", head=head, rows=rows, note=note)


def images_needed(
    place: Path, work: Path, name: str, how: Mapping[str, Any], device: str, data: dict[str, Any]
) -> Table:
    """Errors over the number of training images, for the same number of steps."""
    rows = []
    for folder, settings in of_shares(place, work, name, how).items():
        found = train(place, folder, settings, device=device)
        rows.append((str(found["images"]["train"]), *cells([found["test"]])))
        data[f"images {found['images']['train']}"] = found["test"]
    head = ("training images", *ERRORS)
    return Table(title="Errors over the number of images", head=head, rows=rows, note="Small network, random split.")


def ablation(place: Path, work: Path, runs: Mapping[str, Any], device: str, data: dict[str, Any]) -> Table:
    """The published error of the depth's loss: (n, 1) against (n)."""
    rows, found = [], open_dataset(place)
    spread = np.std(found.labels["depth_normalized"][found.split("random")["test"]])
    for folder, settings in of_losses(work, runs).items():
        test = train(place, folder, settings, device=device)["test"]
        rows.append((settings.depth_loss, f"{test['accuracy']:.3g}", f"{test['depth_normalized_rmse']:.3g}"))
        data[f"loss {settings.depth_loss}"] = test
    note = f"Paper's heads and loss, random split. The labels' own spread is {spread:.3g}."
    head = ("loss", "accuracy", "depth, normalised")
    return Table(title="What comparing every depth with every label costs", head=head, rows=rows, note=note)


def of_128_pixels(place: Path, work: Path, device: str) -> dict[str, Path]:
    """Networks that look at 128 × 128 pixels, for which run times are claimed; two steps of training will do."""
    found = {}
    for net in ("small", "resnet18"):
        folder = work / f"{net}_128_pixels"
        train(place, folder, Settings(net=net, size=128, images=32, epochs=1, batch=16), device=device)
        found[f"{net}, 128 × 128 pixels"] = folder
    return found


def run_times(work: Path, runs: Mapping[str, Path], device: str, data: dict[str, Any]) -> Table:
    """One image at a time on one core, by torch and as the exported file; and on a GPU, from the host and back."""
    on_gpu, rows = not pick_device(device).is_cpu, []
    exports = all(importlib.util.find_spec(name) is not None for name in ("onnx", "onnxruntime"))
    for name, run in runs.items():
        ways = [(load(run, device="cpu", threads=1), time.process_time)]
        if exports:
            export(run, work / f"{name}.onnx")
            ways.append((load(work / f"{name}.onnx", threads=1), time.process_time))
        ways += [(load(run, device=device), time.perf_counter)] if on_gpu else []
        times = [one_image(network, clock) for network, clock in ways]
        shown = [f"{t:.2g}" for t in times]
        rows.append((name, *(shown if exports else [shown[0], NOTHING, *shown[1:]])))
        data[f"run time {name}"] = times
    head = ("network", "torch, one core", "onnxruntime, one core", *(("torch, GPU",) if on_gpu else ()))
    note = "Medians of 50 images, from the host and back: processor time on a core"
    note += "; wall time on a GPU, as one graph." if on_gpu else "."
    return Table(title="An image [ms]", head=head, rows=rows, note=note)


def one_image(network: Estimator, clock: Callable[[], float]) -> float:
    """Median time in which a network sees an image [ms], after ten that are not counted."""
    image, times = np.zeros((1, *network.shape), dtype=np.uint8), []
    for _ in range(60):
        begun = clock()
        network.predict(image)
        times.append(clock() - begun)
    return 1e3 * float(np.median(times[10:]))


if __name__ == "__main__":
    command(
        measure,
        "Networks on images of robots.",
        rounds=1,
        full={"action": "store_true", "help": "the paper's layout and networks: hours on a GPU"},
        folder={"type": Path, "default": None, "help": "keeps data sets and trainings, and finds them again"},
        devices={
            "nargs": "+",
            "default": (),
            "help": "trainings at the same time: cuda:0 cuda:0 cuda:1 cuda:1 for four",
        },
        speed={"action": "store_true", "help": "only how fast networks train, beside a bare loop, and look: minutes"},
    )
