"""Images of environments: milliseconds of one as an observation, by task, size and binning, and of the step before it;
pictures a second of the render mode `rgb_array`, by size."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from benchmarks.report import Section, command
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.bench.timing import Quartiles, elapsed
from otwarp.device import pick_device
from otwarp.envs.batch import Batch
from otwarp.envs.images import Images
from otwarp.envs.picture import Picture
from otwarp.envs.registration import task_of

MEASURED = ("otwarp/Navigate-v0", "otwarp/Push-v0", "otwarp/Orient-v0", "otwarp/CellDelivery-v0")
SIZES = ((64, 1), (64, 2), (64, 4), (84, 2), (128, 1))
"""Pixels of a side of the image, and of the camera in each of them."""
WARM_UP, PERIODS = 2, 3
"""Periods before those that are timed, and of a round."""

DRAWN = ("otwarp/Navigate-v0", "otwarp/CellDelivery-v0")
PICTURE_SIZES = ((240, 180), (480, 360), (960, 720))
"""Width and height of pictures [pixels]."""
MANY = 16
"""Environments whose images are taken at once, beside one."""


def costs(name: str, device: Any, rounds: int, size: int, binning: int, worlds: int = 1) -> dict[str, Any]:
    """Time of a period and of the image after it [s], each of so many worlds under constant actions."""
    task = task_of(name, observation="image", image_size=(size, size), image_binning=binning)
    batch = Batch(task, worlds, device=device, autoreset="off")
    images = Images(batch)
    batch.restart(seeds=np.arange(worlds))
    batch.actions.assign(np.full(batch.actions.shape, 0.1, dtype=np.float32))
    found: dict[str, list[float]] = {"step": [], "image": []}
    for n in range(WARM_UP + rounds * PERIODS):
        times = {"step": elapsed(batch.step, device).wall, "image": elapsed(partial(images.record), device).wall}
        for what, seconds in times.items():
            found[what] += [seconds / worlds] if n >= WARM_UP else []
    field = size * binning * images.camera.pixel_size
    return {"field": field, **{what: Quartiles.of(seconds) for what, seconds in found.items()}}


def pictures(device: Any, rounds: int, data: dict[str, Any]) -> Table:
    """Pictures a second as `render()` draws them, and how fast a video of the control's rate is made of them."""
    rows = []
    for name in DRAWN:
        task = task_of(name)
        batch = Batch(task, 1, device=device, autoreset="off")
        batch.restart(seeds=np.arange(1))
        for size in PICTURE_SIZES:
            draw = partial(Picture(batch, size).draw, 0)
            draw()
            times = Quartiles.of([elapsed(draw, device).on(device) for _ in range(rounds)])
            rate = 1.0 / times.median
            rows.append((f"`{name}`", "{} × {}".format(*size), times.times(1e3).text(".3g"), f"{rate:.3g}",
                         f"{rate / task.rate:.2g}"))  # fmt: skip
            data[f"picture {name} {size[0]}"] = vars(times)
    return Table(
        title="Pictures of `rgb_array`",
        head=("task", "pixels", "picture [ms]", "pictures/s", "over the control's rate"),
        rows=rows,
        note="`Env.render()` draws 480 × 360. The last column is how much faster than it plays a video is drawn that "
        "has a picture of every period. Median and quartiles, of processor time on a CPU.",
    )


def measure(device: str = "cpu", *, rounds: int = 5) -> Section:
    """What images cost beside steps."""
    place = pick_device(device)
    kind = "cpu" if place.is_cpu else "cuda"
    rows, data = [], {}
    for name in MEASURED:
        for size, binning in SIZES:
            found = costs(name, place, rounds, size, binning)
            milliseconds = [found[what].times(1e3).text(".3g") for what in ("image", "step")]
            many = costs(name, place, 1, size, binning, MANY)["image"].times(1e3).text(".3g") if binning == 2 else "–"
            rows.append((f"`{name}`", f"{size} × {size}", str(binning), f"{found['field']:.3g}", *milliseconds, many))
            data[f"{name} {size} {binning}"] = {**found, **{w: vars(found[w]) for w in ("image", "step")}}
    table = Table(
        title="An image and the step before it",
        head=(
            "task",
            "pixels",
            "binning",
            "side [µm]",
            "image [ms]",
            "step without [ms]",
            f"image of {MANY} at once, each [ms]",
        ),
        rows=rows,
        note="Of one environment, and of several: a GPU computes their images together, a CPU one after the other. "
        "Median and quartiles.",
    )
    tables = [table, pictures(place, rounds, data)]
    return Section(name="envs_images", kind=kind, machine=Machine.look(place), tables=tables, data=data)


if __name__ == "__main__":
    command(measure, "Images as observations of environments: milliseconds of one.", rounds=5)
