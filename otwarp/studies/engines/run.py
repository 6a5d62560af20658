"""`run_study`: make or find the folder of a study, and compute the blocks that are not there."""

from __future__ import annotations

import contextlib
import functools
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.scene import Scene, export_flattened
from otwarp.scene.digest import scene_digest
from otwarp.studies.any_study import AnyStudy
from otwarp.studies.asked import texts_of
from otwarp.studies.differences import difference
from otwarp.studies.engines.create import create
from otwarp.studies.engines.local import Engine, blocks_of, on_this_host
from otwarp.studies.engines.rounds import spend
from otwarp.studies.store import Store, Variable, check_versions


def run_study(
    study: AnyStudy,
    folder: str | Path,
    *,
    devices: list[str] | None = None,
    shard: tuple[int, int] | None = None,
    engine: Engine | None = None,
    progress: Callable[[int, int], None] | None = None,
    allow_version: bool = False,
) -> Store:
    """Compute what is missing of a study; called again after whatever ended it, it goes on.

    Args:
        study: What is asked.
        folder: Gets the store; see `otwarp.studies.store`.
        devices: Names of devices of this host; None: all GPUs, or the CPU.
        shard: Which of how many shares, counted from 1: no two compute the same block.
        engine: Who computes, such as `otwarp.studies.engines.on_ray.ray_engine(…)`; None: this process on `devices`.
        progress: Called with blocks done and blocks in all; of a study with a budget, with trials and the budget.
        allow_version: Whether to go on with what another version of otwarp, Warp or NumPy has begun.

    Raises:
        InputError: Another study, or one of another version, is in the folder, it cannot be written, another driver
            runs it, or an argument is out of range.
        OSError: The disk is full; what was finished is kept.
    """
    folder, devices = _path(folder), _devices(devices, here=engine is None)
    _check_shard(shard)
    for name, given in (("engine", engine), ("progress", progress)):
        if given is not None and not callable(given):
            raise InputError(f"{name} is {given!r}; allowed: a function, or None")
    rounds = study.stop.budget is not None
    if rounds and shard is not None:
        raise InputError(f"--shard is {shard[0]}/{shard[1]}; allowed for a study with a budget: none, all points share "
                         "it; --engine ray for several hosts")  # fmt: skip
    study = _as_begun(study, folder)
    store = prepare(study, folder)
    say = progress or (lambda done, of: None)
    todo = blocks_of(study, store, shard)
    if not rounds:
        say(len(store.finished()), len(study.blocks()))
    if todo:
        check_versions(store, allowed=allow_version)
        store.check_writable()
        compute = engine or on_this_host(devices or all_devices())
        with store.claimed() if shard is None else contextlib.nullcontext():
            if rounds:
                spend(study, store, compute, say)
            else:
                compute(study, store, todo, say)
    return store


def _path(folder: Any) -> Path:
    if not isinstance(folder, str | os.PathLike):
        raise InputError(f"folder is {folder!r}; allowed: a path")
    return Path(folder)


def _devices(given: Any, *, here: bool) -> list[str] | None:
    """Names of devices, which there are if they are `here`; None or an empty list stays as it is."""
    from otwarp.device import pick_device

    if given is None:
        return None
    if not isinstance(given, list | tuple) or not all(isinstance(name, str) for name in given):
        raise InputError(f"devices are {given!r}; allowed: a list of names, such as ['cpu']")
    return [str(pick_device(name)) for name in given] if here else list(given)


def _check_shard(shard: Any) -> None:
    """Refuse what is no share, counted from 1.

    Raises:
        InputError: It is none.
    """
    if shard is None:
        return
    pair = isinstance(shard, list | tuple) and len(shard) == 2
    if not pair or not all(isinstance(n, int | np.integer) and not isinstance(n, bool) for n in shard):
        which, of = 0, 0
    else:
        which, of = shard
    if not 1 <= which <= of:
        raise InputError(f"shard is {shard!r}; allowed: which one of how many, counted from 1, such as (3, 16)")


def all_devices() -> list[str]:
    """Every GPU, or the CPU where there is none."""
    import warp as wp

    from otwarp.device import pick_device

    pick_device(None)
    return [str(d) for d in wp.get_cuda_devices()] or ["cpu"]


def prepare(study: AnyStudy, folder: Path) -> Store:
    """The folder of a study, made with everything but the results, or found.

    Raises:
        InputError: It holds another study, or cannot be written.
    """
    _need_zarr()
    study = _as_begun(study, folder)
    if (folder / "study.json").exists():
        _check_scene(study, Store(folder))
    design, runner = study.design, study.runner
    dims = tuple(d.name for d in design.dimensions)
    variables, extents = study.variables(dims)
    shape = dict(zip(dims, design.shape, strict=True)) | extents
    first = study.blocks()[0]
    chunk = {d: s.stop - s.start for d, s in zip(dims, first, strict=True)} | extents
    found = design.coordinates()
    coordinates = {n: Variable(d, "f8", None if v.dtype.kind == "U" else np.nan, a) for n, (d, v, a) in found.items()}
    arrays = {n: v for n, (_, v, _) in found.items()}
    counts = study.step_counts
    if np.any(counts != runner.steps):  # steps of their own are part of what was planned
        coordinates["time_step"] = Variable(dims, "f8", np.nan, {"units": "s", "long_name": "time step"})
        arrays["time_step"] = (study.horizon / counts).reshape(design.shape)
    return create(
        folder,
        study.asked(),
        functools.partial(export_flattened, design.variations.file),
        coordinates,
        arrays,
        variables,
        shape,
        chunk,
        texts_of(study),
    )


def _as_begun(study: AnyStudy, folder: Path) -> AnyStudy:
    """The study in the blocks of its folder, if that is there: another version, or step, may have cut it otherwise."""
    if not (folder / "study.json").exists():
        return study
    cut = Store(folder).cut()
    return study.in_blocks(cut) if len(cut) == len(study.design.shape) else study


def _check_scene(study: AnyStudy, store: Store) -> None:
    """Refuse to go on with another scene than the one that the folder holds.

    Raises:
        InputError: They differ; the message says in what.
    """
    here = study.design.scene
    if store.asked()["scene"]["sha256"] == scene_digest(here):
        return
    where, there, now = difference(Scene.load(store.scene), here) or ("digest", "one", "another")
    raise InputError(f"{store.folder}: holds a study of another scene: {where} is {there} there, {now} now; "
                     "allowed: the same scene, or a new folder")  # fmt: skip


def _need_zarr() -> Any:
    try:
        import zarr
    except ImportError:
        raise InputError("stores of studies need zarr; install otwarp[studies]") from None
    return zarr
