"""What an axis turns: a parameter of `Simulation`, where a body starts, an attribute of the scene, or a speed.

| name | what it turns | unit |
|---|---|---|
| `trap_power`, `medium_temperature`, … | a parameter that may differ per world, of all traps or bodies | its own |
| `trap_power:/World/Traps/trap` | the same of one of them | |
| `trap_position.x:/World/Traps/trap` | one component of a vector, of a start as well | |
| `start:/World/bead` | where a body starts, its prim's origin | µm |
| `turn:/World/robot`, `turn.z:/World/robot` | how far it starts turned, a rotation vector | rad |
| `/World/bead/sphere.radius` | any attribute of the stage | the attribute's |
| `speed:/World/Traps/trap` | the highest speed of its path; all traps go along, obstacles keep their time | µm/s |

Points that differ in the last two rows have models of their own: they are stepped in groups.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.scene.read.variations import Variations, nearest, vocabulary_row
from otwarp.simulation.packing.parameters import PARAMETERS, Parameter, check_range
from otwarp.studies.axes import Axis

Kind = Literal["parameter", "start", "turn", "attribute", "speed"]
COMPONENTS = {"x": 0, "y": 1, "z": 2}


@dataclass(frozen=True)
class Target:
    """What a name means in a scene.

    Attributes:
        name: As it was written.
        kind: What it turns.
        key: Name of the parameter, path of the attribute, or path of the prim.
        index: Of the trap or body, None for all of them.
        component: Of a vector, None for all of it or a number.
        unit: In which `values` are handed on.
        vector: Whether a value is three numbers.
    """

    name: str
    kind: Kind
    key: str
    index: int | None = None
    component: int | None = None
    unit: str = ""
    vector: bool = False

    @property
    def grouped(self) -> bool:
        """Whether points that differ in it have models of their own."""
        return self.kind in ("attribute", "speed")

    def values(self, axis: Axis) -> np.ndarray:
        """(n) or (n, 3) values of an axis in the unit of the target.

        Raises:
            InputError: Another unit, vectors for numbers or numbers for vectors, or a value out of range.
        """
        if axis.values.dtype.kind != "f":
            if self.kind == "attribute" and not axis.unit:
                return axis.values
            raise InputError(
                f"axis {self.name} has the value {axis.values[0].item()!r}; allowed: numbers in {self.unit or '1'}"
            )
        values = axis.in_unit(self.unit, f"axis {self.name}")
        if self.kind != "attribute" and (values.ndim == 2) != self.vector:
            wanted = "three numbers each" if self.vector else "one number each"
            raise InputError(f"axis {self.name} has values of shape {values.shape}; allowed: {wanted}")
        if self.kind == "parameter" and self.component is None:
            check_range(self.name, PARAMETERS[self.key], values)
        if self.kind == "speed" and np.any(values <= 0.0):
            raise InputError(f"axis {self.name} has the value {values.min():g} {self.unit}; allowed: above 0")
        return values


def target_of(name: str, scene: Scene, variations: Variations) -> Target:
    """What a name means.

    Raises:
        InputError: Nothing of that name, with the nearest one there is.
    """
    if name.startswith("/"):
        return _attribute(name, scene, variations)
    what, _, prim = name.partition(":")
    key, _, letter = what.partition(".")
    if letter and letter not in COMPONENTS:
        raise InputError(f"axis {name} has the component {letter!r}; allowed: x, y, z")
    component = COMPONENTS.get(letter)
    if key in ("start", "turn"):
        index = _index(name, prim, scene.bodies)
        unit = "µm" if key == "start" else "rad"
        return Target(name, key, prim, index, component, unit, component is None)  # type: ignore[arg-type]
    if key == "speed":
        trap = scene.traps[_index(name, prim, scene.traps)]
        if letter or not trap.position.animated:
            why = "a number has no component" if letter else f"{prim} stands still"
            raise InputError(f"axis {name}: {why}; allowed: speed of a trap that follows time samples")
        return Target(name, "speed", prim, unit="µm/s")
    if key not in PARAMETERS:
        known = [*PARAMETERS, "start:", "turn:", "speed:"]
        raise InputError(f"axis {name} is none of this scene{nearest(key, known)}")
    spec = PARAMETERS[key]
    if letter and spec.width != 3:
        raise InputError(f"axis {name}: {key} is a number and has no component; allowed: {key}")
    index = _index(name, prim, _owners(spec, scene)) if prim else None
    return Target(name, "parameter", key, index, component, spec.unit, spec.width == 3 and component is None)


def _attribute(name: str, scene: Scene, variations: Variations) -> Target:
    """An attribute of the stage; where worlds may differ in it, the parameter that says so."""
    unit = variations.unit(name)
    prim, _, attribute = name.partition(".")
    row = vocabulary_row(attribute)
    if row is not None and len(row.per_world) == 1 and not row.per_world_unit:
        spec = PARAMETERS[row.per_world[0]]
        owners = [owner.prim for owner in _owners(spec, scene)]
        if spec.of == "" or owners.count(prim) == 1:
            index = owners.index(prim) if spec.of else None
            return Target(name, "parameter", row.per_world[0], index, None, spec.unit, spec.width == 3)
    return Target(name, "attribute", name, unit=unit)


def _owners(spec: Parameter, scene: Scene) -> Sequence[Any]:
    return {"traps": scene.traps, "bodies": scene.bodies}.get(spec.of, ())


def _index(name: str, prim: str, owners: Sequence[Any]) -> int:
    """Which of the traps or bodies has that prim, or that name of an instance."""
    names = [getattr(owner, "name", owner.prim) for owner in owners]
    if prim in names:
        return names.index(prim)
    raise InputError(f"axis {name}: {prim or 'no prim'} is none of {', '.join(names) or 'those that there are'}"
                     f"{nearest(prim, names) if prim else ''}")  # fmt: skip


def fastest(scene: Scene, prim: str) -> float:
    """The highest speed of a trap along its time samples [µm/s]."""
    track = next(t for t in scene.traps if t.prim == prim).position
    return float((np.linalg.norm(np.diff(track.values, axis=0), axis=1) / np.diff(track.times)).max())


def variant(scene: Scene, variations: Variations, values: Mapping[Target, Any]) -> Scene:
    """The scene of a group: with other attributes, and its paths at other speeds.

    Raises:
        InputError: A scene that cannot be accepted, or two speeds.
    """
    attributes = {t.key: value for t, value in values.items() if t.kind == "attribute"}
    speeds = [(t, value) for t, value in values.items() if t.kind == "speed"]
    if len(speeds) > 1:
        raise InputError(f"axes {', '.join(t.name for t, _ in speeds)}; allowed: one speed, all paths go along")
    given = variations.scene(attributes) if attributes else scene
    for target, value in speeds:
        # how fast is what is asked: no speed is odd here
        given = replace(given.with_trap_speed(value / fastest(given, target.key)), judged=True)
    return given
