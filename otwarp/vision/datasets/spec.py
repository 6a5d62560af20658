"""The file of a data set: which robot, how it lies, through which optics it is seen, what varies, how it is split.

In TOML:

    seed = 7
    scene = "../scenes/strategy_b.usda"     # a robot, optics and sensor; or [[sphere]] with center, radius, index
    body = "/World/robot"

    [image]
    width = 224                             # pixels; height where it differs

    [tilts]
    classes = { from = 0, to = 90, count = 19 }     # degrees, or a list
    between = 1                             # tilts of no class in every gap

    [depth]
    from = -6                               # µm, of the robot's centre above the focal plane
    to = 6
    count = 300

    [optics]                                # of `Microscope`, where the scene's camera says something else
    [sensor]                                # of `Sensor`
    [render]                                # of `Rendering`, and `volume`: the largest height of a robot [µm]
    [domain]                                # what varies: number, { from, to } or { values }
    [splits]                                # random = [200, 50, 50] of every class, …
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from otwarp import shipped
from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.vision.datasets.domain import Range, domain_of, number, truth, whole
from otwarp.vision.datasets.robot import Robot
from otwarp.vision.microscope import Microscope
from otwarp.vision.rendering import Rendering
from otwarp.vision.sensor import Sensor
from otwarp.vision.view import microscope_of, sensor_of

KEYS = ("seed", "scene", "body", "axis", "sphere", "rod", "image", "tilts", "depth", "robots", "poses", "optics",
        "sensor", "render", "domain", "splits")  # fmt: skip
ZERNIKE = {"defocus": 4, "astigmatism": 6, "coma": 8, "spherical": 11}
"""Names of aberrations → Noll's numbers."""
SPLITS = ("random", "focus_blocks", "unseen_tilts", "unseen_robots")


@dataclass(frozen=True, kw_only=True, eq=False)
class Spec:
    """A data set as it is asked for.

    Attributes:
        robot: Its first one; others of the class vary in what `domain` says of robots.
        robots: How many of them.
        poses: Of each tilt of each robot, which differ in what `domain` draws for poses.
        classes: (c) tilts that have a class, increasing [deg].
        between: Tilts of no class in every gap between classes, evenly.
        depth: Ends of the focus sweep [µm].
        count, between_count: Focal positions of a pose of a class, and of one between.
        scattered: Whether these are drawn at random from the sweep, instead of evenly.
        width, height: Of images [pixels].
        microscope, sensor, rendering: Where nothing varies.
        volume: Largest height of the robot along the light [µm]; None: the side of the square that is computed.
        domain: What varies.
        splits: Which, with their options; see `otwarp.vision.datasets.splits`.
        seed: Key of all random numbers.
        text: Of the file, or empty.
    """

    robot: Robot
    classes: np.ndarray
    depth: tuple[float, float]
    count: int
    width: int
    height: int
    microscope: Microscope
    sensor: Sensor = field(default_factory=Sensor)
    rendering: Rendering = field(default_factory=Rendering)
    robots: int = 1
    poses: int = 1
    between: int = 0
    between_count: int = 0
    scattered: bool = False
    volume: float | None = None
    domain: Mapping[str, Range] = field(default_factory=dict)
    splits: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0
    text: str = ""

    def described(self) -> dict[str, Any]:
        """Everything that decides about images and labels, for a manifest."""
        return {
            "robot": self.robot.described(),
            "symmetry": self.robot.symmetry(),
            "classes": self.classes.tolist(),
            "optics": dataclasses.asdict(self.microscope) | {"zernike": _texts(self.microscope.zernike)},
            "sensor": {n: v if np.isfinite(v) else str(v) for n, v in dataclasses.asdict(self.sensor).items()},
            "rendering": dataclasses.asdict(self.rendering),
            "layout": {"robots": self.robots, "poses": self.poses, "between": self.between, "count": self.count,
                       "between_count": self.between_count, "depth": list(self.depth), "scattered": self.scattered,
                       "width": self.width, "height": self.height},
            "domain": {name: dataclasses.asdict(r) | {"values": list(r.values)} for name, r in self.domain.items()},
            "splits": {name: _plain(how) for name, how in self.splits.items()},
            "seed": self.seed,
        }  # fmt: skip


def load_spec(file: str | Path) -> Spec:
    """The data set that a file describes.

    Raises:
        InputError: The file is not there, is no TOML, or says what is not allowed; one line that names it.
    """
    path = Path(file)
    try:
        text = path.read_text(encoding="utf-8")
        said = tomllib.loads(text)
    except FileNotFoundError:
        hint = shipped.hint("vision", path)
        raise InputError(f"{path}: there is no such file; allowed: a data set in TOML{hint}") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    try:
        return _spec(said, path.parent, text)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _spec(said: dict[str, Any], folder: Path, text: str) -> Spec:
    _known(said, "the file", KEYS)
    scene = _scene(said, folder)
    axis = _vector(said["axis"], "axis") if "axis" in said else None
    robot = _solids(said, axis) if scene is None else Robot.of_body(scene, said.get("body"), axis)
    image = _known(_table(said, "image"), "image", ("width", "height"))
    width = whole(image.get("width"), "image, width,", 8, 4096)
    tilts = _known(_table(said, "tilts"), "tilts", ("classes", "between"))
    depth = _known(_table(said, "depth"), "depth", ("from", "to", "count", "between_count", "scattered"))
    count = whole(depth.get("count"), "depth, count,", 1, 100_000)
    between = whole(tilts.get("between", 0), "tilts, between,", 0, 1000)
    domain = domain_of(_table(said, "domain"))
    low, high = number(depth.get("from"), "depth, from,"), number(depth.get("to"), "depth, to,")
    if not -1e3 <= low <= high <= 1e3:
        raise InputError(
            f"depth goes from {low:g} to {high:g} µm; allowed: from the smaller to the larger, within ±1000"
        )
    microscope, sensor = _optics(said, scene)
    rendering, volume = _rendering(said)
    if "azimuth" in domain and rendering.rings == "auto":
        raise InputError(
            "domain has azimuth, by which rings of source points are turned; allowed where rings is a number"
        )
    splits = _known(_table(said, "splits"), "splits", SPLITS)
    return Spec(
        robot=robot,
        classes=_classes(tilts.get("classes")),
        depth=(low, high),
        count=count,
        width=width,
        height=whole(image.get("height", width), "image, height,", 8, 4096),
        microscope=microscope,
        sensor=sensor,
        rendering=rendering,
        robots=whole(said.get("robots", 1), "robots", 1, 100_000),
        poses=whole(said.get("poses", 1), "poses", 1, 100_000),
        between=between,
        between_count=_between_count(depth, count, between),
        scattered=truth(depth.get("scattered", False), "depth, scattered,"),
        volume=volume,
        domain=domain,
        splits=splits,
        seed=whole(said.get("seed", 0), "seed", 0, 2**32 - 1),
        text=text,
    )


def _between_count(depth: Mapping[str, Any], count: int, between: int) -> int:
    """Focal positions of a tilt of no class; 0 where there are none, yet what the file says is looked at."""
    given = whole(depth.get("between_count", count), "depth, between_count,", 1 if between else 0, 100_000)
    return given if between else 0


def _scene(said: Mapping[str, Any], folder: Path) -> Scene | None:
    if "scene" not in said:
        if "body" in said:
            raise InputError(f"body is {said['body']!r}; allowed where there is a scene")
        return None
    if "sphere" in said or "rod" in said:
        raise InputError("there are scene and sphere or rod; allowed: one of them")
    if not isinstance(said["scene"], str):
        raise InputError(f"scene is {said['scene']!r}; allowed: the path of a scene, from the file's own folder")
    return Scene.load(shipped.find("scenes", said["scene"], beside=folder))


def _solids(said: Mapping[str, Any], axis: np.ndarray | None) -> Robot:
    """The robot of [[sphere]] and [[rod]]."""
    rows = []
    for kind, ends in (("sphere", ("center", "center")), ("rod", ("start", "end"))):
        tables = said.get(kind, [])
        if not isinstance(tables, list) or not all(isinstance(t, dict) for t in tables):
            raise InputError(f"{kind} is {tables!r}; allowed: tables, [[{kind}]]")
        for n, table in enumerate(tables, start=1):
            name = f"{kind} {n}"
            _known(table, name, (*dict.fromkeys(ends), "radius", "index"))
            rows.append((*(_vector(table.get(end), f"{name}, {end},", 1e3) for end in ends),
                         number(table.get("radius"), f"{name}, radius,", 1e-3, 1e3),
                         number(table.get("index", 1.52), f"{name}, index,", 1.0, 4.0)))  # fmt: skip
    if not rows:
        raise InputError("there is no robot; allowed: scene, or [[sphere]] and [[rod]]")
    start, end, radius, index = (np.array(column, dtype=float) for column in zip(*rows, strict=True))
    return Robot.of_solids(start, end, radius, index, axis=axis)


def _classes(given: Any) -> np.ndarray:
    if isinstance(given, Mapping) and set(given) == {"from", "to", "count"}:
        low, high = (number(given[end], f"tilts, classes, {end},", -90.0, 90.0) for end in ("from", "to"))
        found = np.linspace(low, high, whole(given["count"], "tilts, classes, count,", 1, 100_000))
    elif isinstance(given, list) and given:
        found = np.array([number(v, "tilts, classes,", -90.0, 90.0) for v in given])
    else:
        raise InputError(
            f"tilts, classes, is {given!r}; allowed: {{ from = …, to = …, count = … }} or a list, in degrees"
        )
    if np.any(np.diff(found) <= 0.0):
        raise InputError(f"tilts, classes, is {given!r}; allowed: increasing degrees, each once")
    return found


def _optics(said: Mapping[str, Any], scene: Scene | None) -> tuple[Microscope, Sensor]:
    """Of the scene's camera, and what the file says instead."""
    fields = {f.name for f in dataclasses.fields(Microscope)} - {"zernike", "depth"}
    given = _known(_table(said, "optics"), "optics", (*sorted(fields), "glass_depth", *ZERNIKE))
    there = scene is not None and scene.camera is not None
    base = microscope_of(scene) if scene is not None and there else Microscope()
    changes: dict[str, Any] = {}
    zernike = dict(base.zernike)
    for name, value in given.items():
        if name in ZERNIKE:
            zernike[ZERNIKE[name]] = number(value, f"optics, {name},", -10.0, 10.0)
        elif name in ("condenser", "contrast"):
            changes[name] = value
        else:
            changes["depth" if name == "glass_depth" else name] = number(value, f"optics, {name},")
    microscope = dataclasses.replace(base, zernike=zernike, **changes)
    sensor = sensor_of(scene) if scene is not None and there else Sensor()
    names = [f.name for f in dataclasses.fields(Sensor)]
    seen = _known(_table(said, "sensor"), "sensor", names)
    for name, value in seen.items():
        if name == "bits":
            whole(value, "sensor, bits,", 1, 8)
        elif value != float("inf"):  # electrons; the sensor refuses others
            number(value, f"sensor, {name},")
    sensor = dataclasses.replace(sensor, **seen)
    if sensor.bits > 8:
        raise InputError(f"bits of the sensor is {sensor.bits}; allowed in a data set: 1 to 8")
    return microscope, sensor


def _rendering(said: Mapping[str, Any]) -> tuple[Rendering, float | None]:
    names = ("method", "thickness", "rings", "margin", "spacing")
    given = dict(_known(_table(said, "render"), "render", (*names, "volume")))
    volume = number(given.pop("volume"), "render, volume,", 1e-3, 1e4) if "volume" in given else None
    for name, value in given.items():
        if name in ("rings", "margin") and value == "auto":
            continue
        if name == "rings":
            whole(value, "render, rings,", 1, 100)
        elif name != "method":
            number(value, f"render, {name},", 0.0 if name == "margin" else 1e-3, 1e3)
    return Rendering(**given), volume


def _table(said: Mapping[str, Any], name: str) -> dict[str, Any]:
    table = said.get(name, {})
    if not isinstance(table, dict):
        raise InputError(f"{name} is {table!r}; allowed: a table, [{name}]")
    return table


def _known(table: dict[str, Any], name: str, allowed: Any) -> dict[str, Any]:
    unknown = [key for key in table if key not in allowed]
    if unknown:
        raise InputError(f"{name} has {unknown[0]}; allowed: {', '.join(allowed)}")
    return table


def _vector(given: Any, name: str, reach: float = 1e6) -> np.ndarray:
    """Three numbers, none farther from 0 than `reach`."""
    if not isinstance(given, list) or len(given) != 3:
        raise InputError(f"{name} is {given!r}; allowed: three numbers")
    return np.array([number(v, name, -reach, reach) for v in given])


def _texts(zernike: Mapping[int, float]) -> dict[str, float]:
    return {str(noll): rms for noll, rms in sorted(zernike.items())}


def _plain(how: Any) -> Any:
    return list(how) if isinstance(how, list | tuple) else how
