"""The folder of a study made as a whole: what was asked, the scene, and arrays of results that hold nothing yet."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.files import check_place, made_apart
from otwarp.studies.store import Store, Variable, check_same


def create(
    folder: Path,
    asked: Mapping[str, Any],
    scene: Callable[[Path], object],
    coordinates: Mapping[str, Variable],
    values: Mapping[str, np.ndarray],
    variables: Mapping[str, Variable],
    shape: Mapping[str, int],
    chunk: Mapping[str, int],
    texts: Mapping[str, str],
) -> Store:
    """Make the folder of a study, or find the same study in it; many processes may do so at once.

    Args:
        asked: What `study.json` is to say.
        scene: Called with a path, writes the flattened scene there.
        coordinates, values: What the dimensions mean.
        variables: Arrays of results.
        shape, chunk: Per dimension its length, and that of a block.
        texts: Per file of the folder what it is to say beside, for people: nothing reads it.

    Raises:
        InputError: The folder holds another study, or cannot be written.
    """
    store = Store(folder)
    if (folder / "study.json").exists():
        check_same(store, asked)
        return store
    check_place(folder, "--out", folder=True)
    _check_empty(folder)
    with made_apart(folder, "study.json") as apart:
        (apart / "done").mkdir()
        scene(apart / store.scene.name)
        _create_arrays(apart / store.results.name, coordinates, values, variables, shape, chunk)
        for name, text in texts.items():
            (apart / name).parent.mkdir(exist_ok=True)
            (apart / name).write_text(text, encoding="utf-8")
        text = json.dumps(asked, indent=1, ensure_ascii=False) + "\n"
        (apart / "study.json").write_text(text, encoding="utf-8")
    check_same(store, asked)  # somebody else's, if two made it at once
    return store


def _check_empty(folder: Path) -> None:
    """Refuse a folder in which there is something else."""
    if folder.exists() and any(not p.name.startswith(".") for p in folder.iterdir()):
        if (folder / "study.json").exists():  # somebody has made it since
            return
        raise InputError(f"--out is {folder}, which holds other files; allowed: a new or empty folder, or this study's")


def _create_arrays(
    place: Path,
    coordinates: Mapping[str, Variable],
    values: Mapping[str, np.ndarray],
    variables: Mapping[str, Variable],
    shape: Mapping[str, int],
    chunk: Mapping[str, int],
) -> None:
    """The zarr group: coordinates with their values, and arrays of results that hold nothing yet."""
    import zarr

    group = zarr.open_group(str(place), mode="w", zarr_format=3)
    for name, variable in {**coordinates, **variables}.items():
        of = values.get(name)
        full = tuple(shape[d] for d in variable.dims)
        array = group.create_array(
            name,
            shape=full,
            chunks=tuple(
                n if of is not None else min(chunk.get(d, n), n) for d, n in zip(variable.dims, full, strict=True)
            ),
            dtype=np.dtype(variable.dtype) if of is None else of.dtype,
            fill_value=variable.fill,
            dimension_names=variable.dims,
            attributes=dict(variable.attrs),
        )
        if of is not None:
            array[...] = of
