"""A page of images of a data set, to look at: tilts across, depths up."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from otwarp.files import written
from otwarp.vision.datasets.labels import Labels
from otwarp.vision.datasets.store import Store

ACROSS, UP = 7, 5


def save_samples(labels: Labels, store: Store, file: Path | None = None) -> Path:
    """Draw some images of some poses as panels (PNG), into the folder or a file of one's own."""
    import zarr
    from matplotlib.figure import Figure

    spec, images = labels.spec, zarr.open_array(str(store.data / "images"), mode="r")
    poses = np.flatnonzero(labels.arrays["tilt_class"][labels.first[:-1]] >= 0)
    poses = poses[np.unique(np.linspace(0, len(poses) - 1, ACROSS).round().astype(int))]
    size = 1.35
    per = min(UP, spec.count)
    figure = Figure(figsize=(size * len(poses) + 0.5, size * per * spec.height / spec.width + 0.35))
    grid = figure.add_gridspec(per, len(poses), left=0.5 / (size * len(poses) + 0.5), right=0.995, bottom=0.01,
                               top=1 - 0.3 / (size * per + 0.35), wspace=0.03, hspace=0.03)  # fmt: skip
    for column, pose in enumerate(poses):
        rows = labels.rows(int(pose))
        which = rows.start + np.unique(np.linspace(0, rows.stop - rows.start - 1, per).round().astype(int))
        for line, row in enumerate(which[::-1]):
            axes = figure.add_subplot(grid[line, column])
            axes.imshow(images[int(row)], cmap="gray", vmin=0, vmax=2**spec.sensor.bits - 1, origin="lower")
            axes.set_xticks([])
            axes.set_yticks([])
            if line == 0:
                axes.set_title(f"{labels.arrays['tilt'][row]:.3g}°", fontsize=8, pad=3)
            if column == 0:
                axes.set_ylabel(f"{labels.arrays['depth'][row]:+.3g} µm", fontsize=8, labelpad=2)
    target = store.folder / "samples.png" if file is None else file
    with written(target) as part:
        figure.savefig(part, dpi=110, format="png")
    return target
