"""Networks that say where a robot is and how it lies: training, evaluation beside baselines and bounds, use.

In comes a data set of `otwarp.vision.datasets`, out come folders with networks; `load` one, and it makes an `Estimate`
of every image. torch is imported where it is used. Open `train` first; floor plan, each file importing only from those
above it:

    estimate                what is said of an image
    library, settings       torch, where it is there; what can be chosen about a training
    targets                 labels as numbers to learn
    modules                 the networks themselves
    data, weights           images on the device; weights to begin with
    learnt                  of which robot, poses and optics a network knows
    build, predict          a network by its name; what it says of many images
    metrics, curves         figures of merit; learning curves
    checkpoint              a training on disk
    captured                steps of an optimiser as CUDA graphs
    prepare                 a training before it begins
    train                   all of these together
    run, onnx_file, use     a network in use, by torch or exported; `load` of either
    baselines, bound        what is reached without networks, and what could be reached at all
    evaluate, figures, report    a network on data sets: numbers, pictures, a page
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from otwarp.lazy import lazy_names

if TYPE_CHECKING:
    from otwarp.vision.networks.estimate import QUANTITIES as QUANTITIES
    from otwarp.vision.networks.estimate import Estimate as Estimate
    from otwarp.vision.networks.run import Estimator as Estimator
    from otwarp.vision.networks.settings import Settings as Settings
    from otwarp.vision.networks.use import load as load

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "estimate": ("QUANTITIES", "Estimate"),
        "run": ("Estimator",),
        "settings": ("Settings",),
        "use": ("load",),
    },
)
