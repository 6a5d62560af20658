"""Data sets of rendered images: a file says which, every label is exact, and the same file gives the same bits.

In comes a file in TOML (or a `Spec`), out comes a folder that `open_dataset` reads. Open `make` first; floor plan, each
file importing only from those above it:

    robot, domain          solids in the robot's own frame; what may vary, and draws of it
    splits                 which images train, validate and test
    spec                   the file
    labels                 everything that is known of every image before one is rendered
    shots                  the images of a pose
    plan                   what it will cost
    manifest, store        what its file `manifest.json` must say; the folder
    samples, card          a page of images, and what the data set holds, for people
    make                   all of these together: `make_dataset`
    open                   `open_dataset`: labels, splits and images, checked
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from otwarp.lazy import lazy_names

if TYPE_CHECKING:
    from otwarp.vision.datasets.labels import Labels as Labels
    from otwarp.vision.datasets.labels import labels_of as labels_of
    from otwarp.vision.datasets.make import make_dataset as make_dataset
    from otwarp.vision.datasets.open import Dataset as Dataset
    from otwarp.vision.datasets.open import open_dataset as open_dataset
    from otwarp.vision.datasets.robot import Robot as Robot
    from otwarp.vision.datasets.robot import rotation as rotation
    from otwarp.vision.datasets.spec import Spec as Spec
    from otwarp.vision.datasets.spec import load_spec as load_spec

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "labels": ("Labels", "labels_of"),
        "make": ("make_dataset",),
        "open": ("Dataset", "open_dataset"),
        "robot": ("Robot", "rotation"),
        "spec": ("Spec", "load_spec"),
    },
)
