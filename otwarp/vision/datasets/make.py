"""`make_dataset`: what a file asks for, rendered by one process or several, begun anew or gone on with."""

from __future__ import annotations

import contextlib
import importlib.metadata
import json
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from pathlib import Path
from typing import Any

from otwarp.device import pick_device
from otwarp.errors import InputError
from otwarp.files import check_place, claimed, made_apart
from otwarp.processes import worker_processes
from otwarp.vision.datasets.card import write_card
from otwarp.vision.datasets.labels import Labels, labels_of
from otwarp.vision.datasets.samples import save_samples
from otwarp.vision.datasets.shots import pose_images
from otwarp.vision.datasets.spec import Spec, load_spec
from otwarp.vision.datasets.store import Store, create_arrays, manifest_of, write_json
from otwarp.vision.fourier import Fourier

Progress = Callable[[int, int], None]
"""(poses done, poses in all), called when one is."""


def make_dataset(
    asked: Spec | Labels | str | Path,
    folder: str | Path,
    *,
    processes: int = 1,
    device: str | None = None,
    progress: Progress | None = None,
) -> Path:
    """Render what is missing of a data set; called again after whatever ended it, it goes on.

    Images are the same bits for any number of processes, and after any interruption.

    Args:
        asked: A file in TOML, what it says, or the labels that follow.
        folder: Gets the data set; see `otwarp.vision.datasets.store`.
        processes: That render side by side on a CPU.
        device: Warp's name; None for a GPU if there is one.
        progress: Called with poses done and in all.

    Returns:
        The folder.

    Raises:
        InputError: Nothing that can be rendered is asked for, the folder holds something else or cannot be written, a
            file in it is lost or damaged, another process works in it, or one of `processes` is killed.
        OSError: The disk is full; what was finished is kept.
    """
    _need_zarr()
    spec = load_spec(asked) if isinstance(asked, str | Path) else asked
    labels = spec if isinstance(spec, Labels) else labels_of(spec)
    place = pick_device(device)
    if processes < 1 or (processes > 1 and place.is_cuda):
        raise InputError(f"--processes is {processes}; allowed: 1 or more, on a GPU 1")
    store, say = prepare(labels, Path(folder)), progress or (lambda done, poses: None)
    sums = store.checksums()
    if sums is not None:
        store.check_there(sums)
        _tidy(store)  # the last process may have been killed between the checksums and this
        say(labels.poses, labels.poses)
        return store.folder
    check_place(store.folder, "the folder of the data set", folder=True)
    with claimed(store.folder, "makes this data set; allowed: one at a time, with --processes"):
        store.begin(labels.arrays)
        done = set(store.finished())
        todo = [pose for pose in range(labels.poses) if pose not in done]
        say(len(done), labels.poses)
        for n, _ in enumerate(_rendered(labels, store, todo, processes, str(place)), start=len(done) + 1):
            say(n, labels.poses)
        _complete(labels, store)
    _tidy(store)
    return store.folder


def prepare(labels: Labels, folder: Path) -> Store:
    """The folder with everything but images, made or found.

    Raises:
        InputError: It holds something else, or cannot be written.
    """
    store, manifest = Store(folder), manifest_of(labels, _versions())
    if not (folder / "manifest.json").exists():
        check_place(folder, "--out", folder=True)
        if folder.exists() and any(not p.name.startswith(".") for p in folder.iterdir()):
            raise InputError(f"--out is {folder}, which holds other files; allowed: a new or empty folder, or this "
                             "data set's")  # fmt: skip
        with made_apart(folder, "manifest.json") as apart:
            (apart / "done").mkdir()
            write_json(apart / "manifest.json", manifest)
            create_arrays(apart / "data.zarr", labels)
    there, here = store.manifest(), json.loads(json.dumps(manifest))
    found = _difference(there, here)
    if found is not None:
        where, was, now = found
        raise InputError(f"{folder}: holds a data set with another {where}: {was} there, {now} now; "
                         "allowed: the same file, or a new folder")  # fmt: skip
    return store


def _rendered(labels: Labels, store: Store, todo: Sequence[int], processes: int, device: str) -> Iterator[int]:
    """Poses, each when it is kept."""
    if processes == 1 or len(todo) < 2:
        fourier = Fourier(device)
        for pose in todo:
            _keep(labels, store, pose, fourier)
            yield pose
        return
    # kernels are compiled once, before there are several processes that would
    _keep(labels, store, todo[0], Fourier(device))
    yield todo[0]
    with worker_processes(min(processes, len(todo) - 1), _begin, (labels, store)) as pool:
        for task in as_completed([pool.submit(_task, pose) for pose in todo[1:]]):
            yield task.result()


_of_process: dict[str, Any] = {}


def _begin(labels: Labels, store: Store) -> None:
    """What a process needs."""
    with contextlib.suppress(ImportError):
        import torch

        torch.set_num_threads(1)
    _of_process.update(labels=labels, store=store, fourier=Fourier("cpu"))


def _task(pose: int) -> int:
    _keep(_of_process["labels"], _of_process["store"], pose, _of_process["fourier"])
    return pose


def _keep(labels: Labels, store: Store, pose: int, fourier: Fourier) -> None:
    store.keep(pose, labels.rows(pose), labels.chunk, pose_images(labels, pose, fourier))


def _complete(labels: Labels, store: Store) -> None:
    """Everything that is written when all poses are there."""
    save_samples(labels, store)
    write_card(labels, store)
    store.finish()


def _tidy(store: Store) -> None:
    """Remove what only the making of a data set needs."""
    shutil.rmtree(store.folder / "done", ignore_errors=True)
    with contextlib.suppress(OSError):  # whoever finds a data set whole need not be allowed to write there
        (store.folder / "driver.lock").unlink()


def _versions() -> dict[str, str]:
    names = ("otwarp", "warp-lang", "numpy", "scipy", "torch", "zarr")
    found = {}
    for name in names:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            found[name] = importlib.metadata.version(name)
    return found


NOT_COMPARED = ("versions", "file")


def _difference(there: Any, here: Any, path: str = "") -> tuple[str, Any, Any] | None:
    """The first entry in which two manifests differ: its name, and both values."""
    if isinstance(there, Mapping) and isinstance(here, Mapping):
        for key in dict.fromkeys([*here, *there]):
            if path or key not in NOT_COMPARED:
                found = _difference(there.get(key), here.get(key), f"{path}.{key}" if path else key)
                if found is not None:
                    return found
        return None
    if isinstance(there, list) and isinstance(here, list) and len(there) == len(here):
        pairs = (_difference(a, b, f"{path}[{n}]") for n, (a, b) in enumerate(zip(there, here, strict=True)))
        return next((found for found in pairs if found is not None), None)
    return None if there == here else (path, there, here)


def _need_zarr() -> None:
    try:
        import zarr  # noqa: F401
    except ImportError:
        raise InputError("data sets need the package zarr; install otwarp[vision]") from None
