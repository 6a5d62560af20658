"""Study files: what `Study` takes, as TOML.

scene = "../scenes/capture.usda"    # from the file's own folder
seed = 7

[[axis]]
name = "trap_power"
grid = { from = 0.1, to = 5, count = 32, spacing = "log" }
unit = "mW"

[[axis]]                            # names that go together
together = [
  { name = "start.x:/World/bead", values = [0.1, 0.2], unit = "µm" },
  { name = "start.z:/World/bead", values = [5.0, 5.5], unit = "µm" },
]

[[observable]]
kind = "trapped"
until = "1 s"

[stop]
half_width = 0.01
at_most = 4096

With [escape] in the place of observables and stop, `EscapeStudy`: its runs, branches, method and all that.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from otwarp import shipped
from otwarp.errors import InputError
from otwarp.simulation.options import StepOptions
from otwarp.studies.axes import scatter_of, together_of
from otwarp.studies.named import observable_of
from otwarp.studies.plan import PER_POINT
from otwarp.studies.quantity import quantity
from otwarp.studies.rare.file import escape_arguments
from otwarp.studies.rare.study import EscapeStudy
from otwarp.studies.stopping.search import stop_of
from otwarp.studies.study import Study

KEYS = ("scene", "seed", "horizon", "every", "time_step", "axis", "observable", "stop", "scatter", "options", "escape")
OPTIONS = ("integrator", "noise", "precision", "fast_math")


def load_study(file: str | Path, *, scene: Path | None = None, sources: Path | None = None) -> Study:
    """The study that a file describes.

    Args:
        file: In TOML.
        scene: Instead of the scene that it names.
        sources: Folder of the functions that it names, instead of its own.

    Raises:
        InputError: The file is not there, is no TOML, or says what is not allowed; one line that names it.
    """
    path = Path(file)
    try:
        text = path.read_text(encoding="utf-8")
        said = tomllib.loads(text)
    except FileNotFoundError:
        raise InputError(
            f"{path}: there is no such file; allowed: a study in TOML{shipped.hint('studies', path)}"
        ) from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    try:
        arguments = _arguments(said, path, sources or path.parent)
        if scene is not None:
            arguments["scene"] = scene
        if "escape" in said:
            study = EscapeStudy(**escape_arguments(arguments, said, _table(said, "escape")))
        else:
            study = Study(**arguments)
        study.text = text
        assert study.step_counts.size  # a step that some point cannot take is the file's fault, too
        return study
    except InputError as error:
        why = str(error)
        raise InputError(why if why.startswith(str(path)) else f"{path}: {why}") from None


def _arguments(said: dict[str, Any], path: Path, sources: Path) -> dict[str, Any]:
    unknown = [key for key in said if key not in KEYS]
    if unknown:
        raise InputError(f"{unknown[0]} is none of its entries; allowed: {', '.join(KEYS)}")
    if not isinstance(said.get("scene"), str):
        raise InputError(f"scene is {said.get('scene')!r}; allowed: the path of a scene, from the file's own folder")
    observables = _tables(said, "observable")
    found: dict[str, Any] = {
        "scene": shipped.find("scenes", said["scene"], beside=path.parent),
        "axes": _axes(_tables(said, "axis")),
        "observables": [observable_of(o, f"observable {n + 1}", sources) for n, o in enumerate(observables)],
        "seed": said.get("seed", 0),
        "scatter": {name: scatter_of(text, f"scatter of {name}") for name, text in _table(said, "scatter").items()},
        "options": _options(_table(said, "options")),
    }
    if "stop" in said:
        found["stop"] = stop_of(_table(said, "stop"))
    for name in ("horizon", "every", "time_step"):
        if name in said:
            whole = name == "time_step" and said[name] == PER_POINT
            found[name] = PER_POINT if whole else quantity(said[name], "s", name)
    return found


def _axes(tables: list[dict[str, Any]]) -> dict[Any, Any]:
    axes: dict[Any, Any] = {}
    for n, table in enumerate(tables, start=1):
        rows = table["together"] if set(table) == {"together"} else [table]
        if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
            raise InputError(f"axis {n} has together = {rows!r}; allowed: a list of tables")
        for row in rows:
            if not isinstance(row.get("name"), str):
                raise InputError(f"axis {n} has the name {row.get('name')!r}; allowed: a text such as 'trap_power'")
        names, columns = [row["name"] for row in rows], together_of(rows)
        # a list that holds one is one, so that a name that stands there twice is seen
        if any(name in axes or (name,) in axes for name in names):
            raise InputError(f"axis {names[0]} stands there twice; allowed: once")
        axes[tuple(names)] = tuple(columns)
    return axes


def _options(given: Mapping[str, Any]) -> StepOptions:
    unknown = [key for key in given if key not in OPTIONS]
    if unknown:
        raise InputError(f"options has {unknown[0]}; allowed: {', '.join(OPTIONS)}")
    return StepOptions(**given)


def _table(said: dict[str, Any], name: str) -> dict[str, Any]:
    table = said.get(name, {})
    if not isinstance(table, dict):
        raise InputError(f"{name} is {table!r}; allowed: a table, [{name}]")
    return table


def _tables(said: dict[str, Any], name: str) -> list[dict[str, Any]]:
    tables = said.get(name, [])
    if not isinstance(tables, list) or not all(isinstance(t, dict) for t in tables):
        raise InputError(f"{name} is {tables!r}; allowed: tables, [[{name}]]")
    return tables
