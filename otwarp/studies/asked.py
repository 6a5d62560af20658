"""What a study asks, as its store says it: equal for equal studies, and only for them."""

from __future__ import annotations

import dataclasses
import hashlib
import inspect
import platform
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from otwarp.kernels.core.functions import digest_of, source_of
from otwarp.scene.digest import scene_digest
from otwarp.studies import store as stores
from otwarp.studies.any_study import AnyStudy
from otwarp.studies.observables import Observable


def asked_by(study: AnyStudy) -> dict[str, Any]:
    """All that its results follow from, as JSON: scene, axes, observables, rule, seed, step, versions."""
    design, options, runner = study.design, study.options, study.runner
    counts = study.step_counts
    settings = design.scene.settings
    axes = {
        d.name: {name: {"values": axis.values.tolist(), "unit": axis.unit} for name, axis in d.columns.items()}
        for d in design.dimensions
    }
    return {
        "version": stores.VERSION,
        "rules": stores.RULES,
        "scene": {"file": str(design.scene.file), "sha256": scene_digest(design.scene)},
        "axes": axes,
        "observables": [described(o) for o in study.observables],
        "stop": study.stop.said(),
        "scatter": {t.name: dataclasses.asdict(s) for t, s in study.scatter},
        "seed": study.seed,
        "blocks": len(study.blocks()),
        "horizon": study.horizon,
        "time step": runner.time_step if np.all(counts == runner.steps) else _each(study),
        "every": runner.every * runner.time_step,
        "options": {
            "integrator": options.integrator or settings.integrator,
            "noise": options.noise or settings.noise,
            "precision": options.precision,
            "fast math": options.fast_math,
            "forces": [f.body_force.name for f in options.forces],
        },
        "versions": stores.versions() | {"python": platform.python_version()},
    }


def texts_of(study: AnyStudy) -> dict[str, str]:
    """What its folder keeps beside, by file: the text of the study's own file, and of files with a user's functions.

    Args:
        study: Which.
    """
    found = {} if study.text is None else {"study.toml": study.text}
    called = [o.function.function for o in study.observables if o.function is not None]
    called += [o.end.predicate.function for o in study.observables if o.end is not None]
    called += [f.body_force.function for f in study.options.forces]
    order = getattr(study, "order", None)
    if order is not None and order.function is not None:
        called.append(order.function.function)
    for function in (f.func if isinstance(f, wp.Function) else f for f in called):
        if function is not None and function.__module__.partition(".")[0] != "otwarp":
            name, text = _source_file(function)
            number = next(n for n in range(len(found) + 1) if found.get(_numbered(name, n), text) == text)
            found[_numbered(name, number)] = text
    return found


def _source_file(function: Callable[..., Any]) -> tuple[str, str]:
    """Name and text of the file that a function is from; of one made elsewhere its own text."""
    file = inspect.getsourcefile(function)
    if file is not None and Path(file).is_file():
        return Path(file).stem, Path(file).read_text(encoding="utf-8")
    return function.__name__, source_of(function) + "\n"


def _numbered(name: str, number: int) -> str:
    """The file of a source, others of whose name may be there."""
    return f"sources/{name}{f'_{number + 1}' if number else ''}.py"


def _each(study: AnyStudy) -> dict[str, Any]:
    """Steps that differ from point to point; which ones stands in the results."""
    digest = hashlib.sha256(study.step_counts.astype("<i8").tobytes()).hexdigest()
    return {
        "least": study.horizon / int(study.step_counts.max()),
        "largest": study.horizon / int(study.step_counts.min()),
        "sha256": digest,
    }


def described(o: Observable) -> dict[str, Any]:
    """What the store says of an observable; of functions, their source's digest."""
    said: dict[str, Any] = {"name": o.name, "kind": o.kind, "unit": o.unit}
    if o.end is not None:
        said |= {
            "end": o.end.name,
            "happens": o.happens,
            "until": o.until,
            "parameters": {k: np.asarray(v).tolist() for k, v in o.end.values.items()},
            "sha256": digest_of(o.end.predicate.function, o.end.name, o.end.predicate.kinds),
        }
    if o.kind == "choice":
        said["choices"] = list(o.choices)
    if o.function is not None:
        said |= {
            "keep": o.keep,
            "parameters": list(o.values),
            "sha256": digest_of(o.function.function, o.name, o.function.kinds),
        }
    return said
