"""Images of `vision/paper.toml` in its own optics, by its own source points: `python -m docs.figures.samples`.

Some tilts and depths of it, as its page of samples has them; drawn in about a minute, and so not by `docs.figures`.
"""

from __future__ import annotations

import dataclasses
import shutil
import tempfile
from pathlib import Path

import numpy as np

from otwarp.vision.datasets import load_spec, make_dataset
from otwarp.vision.datasets.labels import labels_of
from otwarp.vision.datasets.samples import ACROSS, UP
from otwarp.vision.datasets.shots import lights_of_pose

ROOT = Path(__file__).parents[2]
PICTURE = ROOT / "docs" / "images" / "vision_samples.png"


def write() -> None:
    """Render the poses that the page of samples shows, and keep the page."""
    whole = load_spec(ROOT / "vision" / "paper.toml")
    some = whole.classes[np.unique(np.linspace(0, len(whole.classes) - 1, ACROSS).round().astype(int))]
    spec = dataclasses.replace(whole, classes=some, between=0, between_count=0, count=UP, splits={}, text="")
    with tempfile.TemporaryDirectory() as folder:
        made = make_dataset(labels_of(spec), Path(folder) / "samples", device="cpu")
        shutil.copyfile(made / "samples.png", PICTURE)
    points = sum(len(light.weights) for light in lights_of_pose(labels_of(spec), 0))
    print(f"wrote {PICTURE.relative_to(ROOT)}: {points} source points")


if __name__ == "__main__":
    write()
