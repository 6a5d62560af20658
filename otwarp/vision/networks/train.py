"""Training: from a data set to a network on disk, resumable to the bit from its last checkpoint."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.vision.datasets import open_dataset
from otwarp.vision.networks import checkpoint
from otwarp.vision.networks.build import parameters
from otwarp.vision.networks.captured import CapturedSteps, set_rate
from otwarp.vision.networks.curves import draw_curves, write_curves
from otwarp.vision.networks.data import samples
from otwarp.vision.networks.library import check_device_name, memory_named, repeatable, torch_device, torch_library
from otwarp.vision.networks.metrics import scores_of, widening
from otwarp.vision.networks.predict import arithmetic, predict
from otwarp.vision.networks.prepare import Training, dataset_digest, parts_of, prepare
from otwarp.vision.networks.settings import Settings
from otwarp.vision.networks.targets import errors
from otwarp.vision.networks.weights import find_weights, put

SQUARE_SHARE = 0.3
"""Of all steps, in which the loss of a pose goes over from the square to the density."""

LOOK = 50
"""Steps between looks at the loss: each waits for the device."""

LONGEST = 5.0
"""Norm to which gradients of a pose's density are cut."""

Report = Callable[[Mapping[str, Any]], None]

Take = Callable[[Any, float], Any]
"""`(batch, share) -> loss`: a step of the optimiser, as of `one_step`."""


def train(
    dataset: str | Path,
    folder: str | Path,
    settings: Settings,
    *,
    device: str | None = None,
    report: Report | None = None,
) -> dict[str, Any]:
    """Train a network, or go on where a training of the same settings was stopped.

    Args:
        dataset: Folder of a data set.
        folder: Gets the network; `otwarp.vision.networks.checkpoint` says what lies in it.
        settings: How.
        device: torch's name of it; None for a GPU if there is one.
        report: Called after every epoch with a row of the learning curves.

    Returns:
        What `metrics.json` says.

    Raises:
        InputError: No such data set, split, weights or device; another training in the folder; a loss that is not
            finite; or a batch that does not fit the memory of the device. What was written before stays.
    """
    folder = Path(folder)
    check_device_name(device)
    find_weights(settings.net, settings.weights)
    data = open_dataset(dataset)
    parts = parts_of(data.split(settings.split), settings)
    where = torch_device(device)
    asked = {"dataset": dataset_digest(data), "settings": settings.said()}
    checkpoint.check_folder(folder, asked)
    if (folder / checkpoint.METRICS).exists():
        return checkpoint.read_json(folder / checkpoint.METRICS)
    with repeatable(settings.seed), memory_named(f"batch is {settings.batch}, which", where, "a smaller one"):
        # what is refused leaves no folder
        work = prepare(data, parts, folder, settings, where)
        checkpoint.begin(folder, asked)
        if (folder / checkpoint.CHECKPOINT).exists():
            resume(work)
        take = steps_of(work)
        for epoch in range(len(work.rows), settings.epochs):
            row = one_epoch(work, epoch, take)
            keep(work, row)
            if report:
                report(row)
        return finish(work, data)


def steps_of(work: Training) -> Take:
    """How steps are taken: on a GPU as captured graphs."""

    def take(batch: Any, share: Any) -> Any:
        """One step, by launches of its own."""
        return one_step(work, batch, share)

    return CapturedSteps(take, work.network, work.optimiser, work.change) if work.device.type == "cuda" else take


def one_epoch(work: Training, epoch: int, take: Take) -> dict[str, Any]:
    """Take all steps of an epoch, and look at the validation part; a row of the learning curves.

    Args:
        work: The training.
        epoch: Counted from 0.
        take: As of `steps_of`.

    Raises:
        InputError: The loss is not finite.
    """
    torch = torch_library()
    settings, count = work.settings, len(work.train)
    order_seed, change_seed = checkpoint.seeds(settings.seed, epoch)
    order = torch.randperm(count, generator=torch.Generator().manual_seed(order_seed)).to(work.device)
    work.change.manual_seed(change_seed)
    batches = torch.tensor_split(order, max(1, round(count / settings.batch)))
    work.network.train()
    total = torch.zeros((), device=work.device)
    begun = time.perf_counter()
    for n, batch in enumerate(batches):
        step = epoch * len(batches) + n
        rate = settings.rate * settings.factor(step, len(batches))
        set_rate(work.optimiser, rate)
        share = min(1.0, step / (SQUARE_SHARE * settings.epochs * len(batches)))
        total += take(batch, share) * len(batch)
        if n % LOOK == 0 or n == len(batches) - 1:
            check_finite(work, float(total), epoch, n)
    seconds = time.perf_counter() - begun
    row = {"epoch": epoch + 1, "rate": rate, "training_loss": float(total) / count, "seconds": seconds,
           "images_per_second": count / seconds, **validate(work)}  # fmt: skip
    # the last step may have spoilt the weights, which the loss before it does not show
    check_finite(work, row["validation_loss"], epoch, len(batches) - 1)
    return row


def one_step(work: Training, batch: Any, share: Any) -> Any:
    """A step of the optimiser; the loss, on the device.

    Args:
        work: The training.
        batch: (b) indices into its training part.
        share: Of the density in the loss of a pose.
    """
    torch = torch_library()
    from otwarp.vision.networks.modules.augment import augmented

    part = work.train
    images, true = part.images[batch].float() / 255.0, part.truth[batch]
    if work.settings.augment:
        images, steps = augmented(images, work.change)
        for axis, name in enumerate(("x", "y")):
            if name in work.targets.names:
                true[:, work.targets.names.index(name)] += steps[:, axis] / work.stretch[axis]
    with arithmetic(work.settings.precision, work.device):
        said = work.network(images)
    loss = loss_of(work, said, true, part.tilt_class[batch], part.depth[batch], share)
    work.optimiser.zero_grad(set_to_none=True)
    loss.backward()
    if "mean" in said:
        torch.nn.utils.clip_grad_norm_(work.network.parameters(), LONGEST)
    work.optimiser.step()
    return loss.detach()


def loss_of(work: Training, said: Mapping[str, Any], true: Any, tilt_class: Any, depth: Any, share: Any) -> Any:
    """Of all heads together."""
    from otwarp.vision.networks.modules.loss import pose_loss

    loss = loss_of_classes(work, said, tilt_class, depth)
    if "mean" in said:
        loss = loss + pose_loss(residuals_of(work, said, true), said["factor"], share)
    return loss


def loss_of_classes(work: Training, said: Mapping[str, Any], tilt_class: Any, depth: Any) -> Any:
    """Of the paper's heads; 0 without them."""
    from otwarp.vision.networks.modules.loss import paper_loss

    if "scores" not in said:
        return 0.0
    wrong = work.settings.depth_loss == "broadcast"
    return paper_loss(said["scores"].float(), said["depth"].float(), tilt_class, depth, broadcast=wrong)


def residuals_of(work: Training, said: Mapping[str, Any], true: Any) -> Any:
    """(g, n, k) of poses, as of `modules.loss.residuals`."""
    from otwarp.vision.networks.modules.loss import residuals

    scale, names = work.network.pose.scale, work.targets.names
    return residuals(said["mean"], true, scale, names, mirrored=work.targets.mirrored)


def check_finite(work: Training, loss: float, epoch: int, step: int) -> None:
    """Stop a training whose loss is no number any more.

    Raises:
        InputError: It is not; the message says which checkpoint is kept.
    """
    if math.isfinite(loss):
        return
    kept = f"that of epoch {work.kept} is kept in {work.folder}" if work.kept else "there is none yet"
    raise InputError(f"the loss became {loss} in epoch {epoch + 1}, step {step + 1}, at lr {work.settings.rate:g}; "
                     f"allowed: a smaller lr; of checkpoints, {kept}")  # fmt: skip


def validate(work: Training) -> dict[str, Any]:
    """Loss, that of poses calibrated, and errors of the validation part."""
    torch = torch_library()
    from otwarp.vision.networks.modules.loss import calibrated_loss

    part, total, found, away, factor = work.validation, 0.0, {}, [], []
    work.network.eval()
    with torch.inference_mode():
        for some in torch.arange(len(part), device=work.device).split(256):
            with arithmetic(work.settings.precision, work.device):
                said = work.network(part.images[some].float() / 255.0)
            true, tilt_class, depth = part.truth[some], part.tilt_class[some], part.depth[some]
            total += float(loss_of_classes(work, said, tilt_class, depth)) * len(some) / len(part)
            if "scores" in said:
                has = tilt_class >= 0
                found.setdefault("accuracy", []).append((said["scores"].argmax(1) == tilt_class)[has].float())
                found.setdefault("depth_normalized_rmse", []).append((said["depth"].float() - depth) ** 2)
            if "mean" in said:
                away.append(residuals_of(work, said, true))
                factor.append(said["factor"])
            if "depth" in work.targets.names and "mean" in said:
                column = work.targets.names.index("depth")
                found.setdefault("depth_rmse_um", []).append((said["mean"] - true)[:, column] ** 2)
        if away:
            total += float(calibrated_loss(torch.cat(away, 1), torch.cat(factor)))
    row = {name: float(torch.cat(parts).mean()) for name, parts in found.items() if len(torch.cat(parts))}
    row |= {name: math.sqrt(value) for name, value in row.items() if "rmse" in name}
    return {"validation_loss": total, **row}


def keep(work: Training, row: dict[str, Any]) -> None:
    """Write the network if it is the best so far; where the training stands and its curves unless it is too soon."""
    best = min((r["validation_loss"] for r in work.rows), default=math.inf)
    if row["validation_loss"] < best or not work.rows:
        _save_network(work, row["epoch"], ())
    work.rows.append(row)
    with work.checkpoints.if_due() as due:
        if due:
            state = {"network": work.network.state_dict(), "optimiser": work.optimiser.state_dict()}
            checkpoint.save(work.folder / checkpoint.CHECKPOINT,
                            {"version": checkpoint.VERSION, **state, "random": checkpoint.random_state(),
                             "rows": work.rows, "weights": dict(work.weights)})  # fmt: skip
            work.kept = len(work.rows)
    write_curves(work.folder, work.rows)
    with work.pictures.if_due() as due:
        if due:
            draw_curves(work.folder / "curves.png", work.rows)


def _save_network(work: Training, epoch: int, widen: tuple[float, ...]) -> None:
    about = {**work.about, "epoch": epoch, "widen": list(widen), "weights": dict(work.weights)}
    checkpoint.save(work.folder / checkpoint.NETWORK,
                    {"version": checkpoint.VERSION, "about": about, "state": work.network.state_dict()})  # fmt: skip


def resume(work: Training) -> None:
    """Go on from the checkpoint.

    Raises:
        InputError: It is that of another network, or damaged.
    """
    file = work.folder / checkpoint.CHECKPOINT
    found = checkpoint.load(file, "the checkpoint of this training")
    put(work.network, found["network"], f"{file}: checkpoint of another network than {work.settings.net}")
    work.optimiser.load_state_dict(found["optimiser"])
    work.rows[:], work.kept = found["rows"], len(found["rows"])
    checkpoint.set_random_state(found["random"])


def finish(work: Training, data: Any) -> dict[str, Any]:
    """Calibrate the best network on the validation part, say what it reaches on the test part, and write that last."""
    file = work.folder / checkpoint.NETWORK
    found = checkpoint.load(file, "the network of this training")
    put(work.network, found["state"], f"{file}: another network than {work.settings.net}")
    widen: tuple[float, ...] = ()
    precision = work.settings.precision
    if work.network.pose is not None:
        said = predict(work.network, work.targets, work.validation.images, precision=precision)
        true = work.validation.truth.cpu().numpy().astype(float)
        assert said.mean is not None and said.covariance is not None
        away = errors(said.mean, true, work.targets.names, mirrored=work.targets.mirrored)
        widen = widening(away, said.covariance)
    _save_network(work, found["about"]["epoch"], widen)
    test = samples(data, work.parts["test"], np.zeros((len(work.parts["test"]), 0)), work.about["size"], work.device)
    said = predict(work.network, work.targets, test.images, precision=precision, widen=widen)
    metrics = {
        "net": work.settings.net,
        "weights": dict(work.weights),
        "parameters": parameters(work.network),
        "split": work.settings.split,
        "images": {name: len(index) for name, index in work.parts.items()},
        "best_epoch": found["about"]["epoch"],
        "training_seconds": sum(row["seconds"] for row in work.rows),
        "images_per_second": float(np.median([row["images_per_second"] for row in work.rows])),
        "test": scores_of(said, work.targets, data.labels, work.parts["test"]),
    }
    draw_curves(work.folder / "curves.png", work.rows)
    checkpoint.write_json(work.folder / checkpoint.METRICS, metrics)
    return metrics
