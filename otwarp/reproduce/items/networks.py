"""The table of networks: accuracy and F1 of tilts, error of the depth, on the published split and on one that leaks
nothing."""

from __future__ import annotations

import shutil
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError, PlausibilityWarning
from otwarp.reproduce.drawing import FAINT, OURS, OURS_TOO, PAPER, drawn, letter
from otwarp.reproduce.item import Comparison, Figure, Request, Result, Table, Unavailable, Value, scene_file, shown
from otwarp.reproduce.items.networks_plan import FULL, QUICK, SPLITS, Plan, settings_of, write_layout
from otwarp.reproduce.measures import mean_of_trials, share
from otwarp.vision.datasets import make_dataset, open_dataset
from otwarp.vision.networks import Settings
from otwarp.vision.networks.checkpoint import CHECKPOINT, NETWORK
from otwarp.vision.networks.library import torch_library
from otwarp.vision.networks.train import train

PUBLISHED = {"vgg16": (0.99, 0.99, 0.1194), "resnet18": (1.0, 1.0, 0.0288), "resnet50": (1.0, 1.0, 0.0413)}
"""Accuracy, F1 and depth error of the paper."""
TITLES = {"vgg16": "VGG16", "resnet18": "ResNet18", "resnet50": "ResNet50", "small": "small network"}
MEASURES = {"accuracy": "accuracy", "f1": "F1", "depth_normalized_rmse": "depth RMSE"}
"""Keys of a training's metrics, and what they are."""

DEFINITION = """A network names the tilt of the robot in an image, one of the data set's classes, and its depth,
normalised to 0 … 1 within the focus sweep of each pose. Accuracy and F1 (mean over classes) are over the test part of
a split, as is the root mean square error of the normalised depth. Published recipe: cross entropy + 0.8 mean square
error, Adam at 1e-3 with weight decay 1e-4, a tenth every ten epochs; VGG16 from random weights is trained at 1e-4, as
it does not learn at 1e-3. Images are computed from waves, of the five-element robot of `strategy_b.usda` in the paper's
optics. The random split deals single frames, so that a test frame has neighbours of the same sweep in training: that is
the published way. In the other one whole blocks of focus are left out, with a gap."""

QUICK_DEFINITION = """In this quick report a reduced set was trained on a CPU: 570 images resized to 64 pixels, from 19
source points and a margin of 6 µm, which is too few for planes far from focus; VGG16 and ResNet50 are left out, a small
network of 0.8 million weights is added. Its figures show how the command works and what leakage does, and say nothing
about the paper's."""

DIFFERENCE = """Theirs are photographs of printed robots with 3,800 training images and weights from ImageNet; ours
are computed images, and weights as the table says. From random weights ResNet50 does not learn the tilts at the
published rate and in its 20 epochs, so that its accuracy is far below theirs. A random split flatters both: what a
network reaches on blocks of focus that it has not seen is what a lab may count on. The published depth error of VGG16
stands out from those of the other two. One training path of the published notebook compares depths (n, 1) with labels
(n), every one with every other, so that the best estimate is the labels' mean; the table shows what that costs."""

INCOMPARABLE = (
    "The paper's images are private; a network can be compared on them by nobody else.",
    "Its 19 angles and its focal sweep are not stated: 0° to 90° and ±10 µm are assumed.",
    "Its normalised depth is relative to each sweep; in µm it depends on a range that is not stated.",
)


def run(request: Request) -> Result:
    """Render, train, evaluate, draw; what is trained is kept if the command is interrupted."""
    try:
        torch_library()
    except InputError as error:
        raise Unavailable(str(error)) from None
    plan = QUICK if request.quick else FULL
    place, trained = _trained(request, plan)
    right, wrong = trained[plan.ablation, "random", "right"][0], trained[plan.ablation, "random", "broadcast"][0]
    shutil.copyfile(place / "samples.png", request.folder / "networks_samples.png")
    _draw(request.folder / "networks.png", plan, trained)
    data = open_dataset(place)
    size = f"{data.count} images of {data.shape[1]} × {data.shape[0]} pixels, {len(data.classes)} tilts"
    return Result(
        comparisons=_comparisons(plan, trained),
        definition=DEFINITION + (" " + QUICK_DEFINITION if request.quick else ""),
        difference=DIFFERENCE,
        incomparable=INCOMPARABLE,
        computed={"trainings": plan.said, "data": size, "work": _times(trained),
                  "spread": "± over seeds; brackets: Clopper–Pearson interval of the test images"},
        tables=(_table(plan, trained), _ablation(plan, right, wrong, _spread_of_labels(data))),
        figures=(Figure(file="networks.png", caption="(a) Accuracy of tilts and (b) error of the normalised depth: "
                                                     "the paper, "
                        "ours on the published kind of split, ours on blocks of focus that the network has not seen."),
                 Figure(file="networks_samples.png", caption="Images of the data set: the robot at tilts (rows or "
                                                             "columns) "
                        "and focal positions, as a camera sees them.")),
        numbers={f"{name}, {split}, {loss}": rows for (name, split, loss), rows in trained.items()},
    )  # fmt: skip


Trained = dict[tuple[str, str, str], list[dict[str, Any]]]
"""(network, split, loss of the depth) → metrics of each seed."""


def _trained(request: Request, plan: Plan) -> tuple[Path, Trained]:
    """Folder of the data set, and metrics of all trainings."""
    place = request.work / "data"
    layout = write_layout(plan, scene_file(request.scenes, "strategy_b"), request.work / "data.toml")

    def posed(done: int, poses: int) -> None:
        request.say(f"images of pose {done} of {poses}")

    with warnings.catch_warnings():
        if plan.reduced:  # says so itself
            warnings.simplefilter("ignore", PlausibilityWarning)
        make_dataset(layout, place, device=request.device, progress=posed)
    found: Trained = {}
    for split in SPLITS:
        for name in plan.networks:
            found[name, split, "right"] = [
                _one(request, place, f"{name}_{split}_{seed}", settings_of(plan, name, split=split, seed=seed))
                for seed in range(plan.seeds)
            ]
    wrong = settings_of(plan, plan.ablation, split="random", seed=0, depth_loss="broadcast")
    found[plan.ablation, "random", "broadcast"] = [_one(request, place, f"{plan.ablation}_broadcast", wrong)]
    return place, found


def _one(request: Request, place: Path, name: str, settings: Settings) -> dict[str, Any]:
    """Metrics of one training, whose weights go: a table of VGG16 would take 20 GB."""

    def said(row: Mapping[str, Any]) -> None:
        request.say(f"training {name}, epoch {row['epoch']} of {settings.epochs}")

    folder = request.work / name
    found = train(place, folder, settings, device=request.device, report=said)
    for file in (CHECKPOINT, NETWORK):
        (folder / file).unlink(missing_ok=True)
    keep = ("parameters", "images", "best_epoch", "training_seconds", "images_per_second", "weights", "test")
    return {"settings": settings.said(), **{key: found[key] for key in keep}}


def _times(trained: Trained) -> str:
    """How long all trainings took, also those that were done before the command went on, or on another card."""
    seconds = [float(row["training_seconds"]) for rows in trained.values() for row in rows]
    return f"{len(seconds)} trainings of {sum(seconds):.0f} s together"


def _scores(rows: list[dict[str, Any]], key: str) -> Value:
    """Mean over seeds with its spread; of one accuracy the interval of its test images."""
    values = [float(row["test"][key]) for row in rows]
    if len(values) > 1:
        mean, error = mean_of_trials(values)
        return Value(number=mean, spread=float(np.std(values, ddof=1)), error=error)
    if key != "accuracy":
        return Value(number=values[0])
    images = int(rows[0]["test"]["images"])
    return Value(number=values[0], interval=share(round(values[0] * images), images)[1])


def _comparisons(plan: Plan, trained: Trained) -> tuple[Comparison, ...]:
    out = []
    for net, published in PUBLISHED.items():
        for (key, title), theirs in zip(MEASURES.items(), published, strict=True):
            text = f"{theirs:.2f}" if key != "depth_normalized_rmse" else f"{theirs:.4f}"
            there = (net, "random", "right") in trained
            ours = _scores(trained[net, "random", "right"], key) if there else Value(text="not in a quick report")
            remark = f"no leak: {_scores(trained[net, 'focus_blocks', 'right'], key).said()}" if there else ""
            remark = f"reduced set; {remark}" if there and plan.reduced else remark
            chosen = there and net == "resnet18" and key != "f1"
            out.append(Comparison(what=f"{TITLES[net]}, {title}", paper=Value(number=theirs, text=text), grade="S",
                                  ours=ours, remark=remark, key=chosen))  # fmt: skip
    return tuple(out)


def _table(plan: Plan, trained: Trained) -> Table:
    rows = []
    for split, said in SPLITS.items():
        for name in plan.networks:
            some = trained[name, split, "right"]
            seconds = float(np.median([row["training_seconds"] for row in some]))
            rows.append((f"{TITLES[name]}, {said}", *(_scores(some, key).said() for key in MEASURES),
                         some[0]["weights"]["source"], str(some[0]["test"]["images"]), f"{seconds:.0f}"))  # fmt: skip
    head = ("network, split", *MEASURES.values(), "weights to begin with", "test images", "training [s]")
    return Table(title="All trainings", head=head, rows=tuple(rows), note=plan.said[0].upper() + plan.said[1:] + ".")


def _ablation(plan: Plan, right: Mapping[str, Any], wrong: Mapping[str, Any], spread: float) -> Table:
    rows = tuple(
        (said, *(shown(float(one["test"][key])) for key in ("accuracy", "depth_normalized_rmse")))
        for said, one in (("(n) against (n), right", right), ("(n, 1) against (n), as published", wrong))
    )
    note = f"{TITLES[plan.ablation]}, random split, one seed. The labels' own spread is {spread:.3f}."
    head = ("loss of the depth", "accuracy", "depth RMSE")
    return Table(title="What the error of the published loss costs", head=head, rows=rows, note=note)


def _spread_of_labels(data: Any) -> float:
    depth = np.asarray(data.labels["depth_normalized"], dtype=float)
    return float(np.nanstd(depth[data.split("random")["test"]]))


def _draw(path: Path, plan: Plan, trained: Trained) -> None:
    names = list(dict.fromkeys([*PUBLISHED, *plan.networks]))
    bars = (("paper", PAPER, -0.27), ("ours, random frames", OURS, 0.0), ("ours, blocks of focus", OURS_TOO, 0.27))
    with drawn(path, panels=(1, 2), size=(8.4, 2.9)) as (axes,):
        for one, which, key, column in ((axes[0], "a", "accuracy", 0), (axes[1], "b", "depth_normalized_rmse", 2)):
            for label, colour, shift in bars:
                for n, name in enumerate(names):
                    split = "random" if "random" in label else "focus_blocks"
                    if label == "paper":
                        value = Value(number=PUBLISHED[name][column]) if name in PUBLISHED else None
                    else:
                        value = _scores(trained[name, split, "right"], key) if name in plan.networks else None
                    if value is None or value.number is None:
                        continue
                    ends = value.interval or (value.number - (value.spread or 0), value.number + (value.spread or 0))
                    span = [[max(value.number - ends[0], 0.0)], [max(ends[1] - value.number, 0.0)]]
                    one.bar(n + shift, value.number, 0.25, color=colour, label=label if n == 1 else None)
                    if span != [[0.0], [0.0]]:
                        one.errorbar(n + shift, value.number, span, color=FAINT, capsize=2, lw=1.0, ls="none")
            one.set_xticks(range(len(names)), [TITLES[name] for name in names])
            one.set_ylabel("accuracy of tilts" if column == 0 else "error of depth (share of the sweep)")
            letter(one, which)
        if plan.reduced:
            letter(axes[0], "a", "ours: a reduced set, 64 pixels")
        axes[0].legend(loc="upper left", bbox_to_anchor=(0.0, 1.02), ncols=1)
        axes[0].set_ylim(0.0, 1.45)
