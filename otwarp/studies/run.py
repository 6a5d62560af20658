"""`run_study`: make or find the folder of a study, and compute the blocks that are not there."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.scene import export_flattened
from otwarp.studies.engines import blocks_of, run_locally
from otwarp.studies.store import Store, Variable, create
from otwarp.studies.study import Study


def run_study(
    study: Study,
    folder: str | Path,
    *,
    devices: list[str] | None = None,
    shard: tuple[int, int] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Store:
    """Compute what is missing of a study; called again after whatever ended it, it goes on.

    Args:
        study: What is asked.
        folder: Gets the store; see `otwarp.studies.store`.
        devices: Names of devices; None: all GPUs, or the CPU.
        shard: Which of how many shares, counted from 1: no two compute the same block.
        progress: Called with blocks done and blocks in all.

    Raises:
        InputError: Another study is in the folder, another driver runs it, or an argument is out of range.
        OSError: The disk is full; what was finished is kept.
    """
    store = prepare(study, Path(folder))
    say = progress or (lambda done, blocks: None)
    claim = store.claimed() if shard is None else contextlib.nullcontext()
    with claim:
        todo = blocks_of(study, store, shard)
        say(len(store.finished()), len(study.blocks()))
        if todo:
            run_locally(study, store, todo, devices or all_devices(), say)
    return store


def all_devices() -> list[str]:
    """Every GPU, or the CPU where there is none."""
    import warp as wp

    from otwarp.device import pick_device

    pick_device(None)
    return [str(d) for d in wp.get_cuda_devices()] or ["cpu"]


def prepare(study: Study, folder: Path) -> Store:
    """The folder of a study, made with everything but the results, or found.

    Raises:
        InputError: It holds another study, or cannot be written.
    """
    _need_zarr()
    design, runner = study.design, study.runner
    dims = tuple(d.name for d in design.dimensions)
    shape = dict(zip(dims, design.shape, strict=True)) | {"trial": study.stop.at_most}
    first = study.blocks()[0]
    chunk = {d: s.stop - s.start for d, s in zip(dims, first, strict=True)} | {"trial": study.stop.at_most}
    found = design.coordinates()
    coordinates = {n: Variable(d, "f8", None if v.dtype.kind == "U" else np.nan, a) for n, (d, v, a) in found.items()}
    variables = {
        "trials": Variable(dims, "i4", -1, {"long_name": "trials, -1: not computed"}),
        "end": Variable((*dims, "trial"), "i1", -128, {"long_name": "end that came first, from 1; 0 none, -1 a fault"}),
        "end_time": Variable((*dims, "trial"), "f4", np.nan, {"units": "s", "long_name": "when it came"}),
    }
    for o in runner.numbers:
        said = {"long_name": f"{o.name} of each trial, {o.keep}", **({"units": o.unit} if o.unit else {})}
        variables[f"{o.name}_of_trial"] = Variable((*dims, "trial"), "f4", np.nan, said)
    arrays = {n: v for n, (_, v, _) in found.items()}
    return create(
        folder,
        study.asked(),
        functools.partial(export_flattened, design.variations.file),
        coordinates,
        arrays,
        variables,
        shape,
        chunk,
    )


def _need_zarr() -> Any:
    try:
        import zarr
    except ImportError:
        raise InputError("stores of studies need zarr; install otwarp[studies]") from None
    return zarr
