"""The one table of the scene vocabulary: every `ot:` attribute, its field, dimension, default and allowed range.

The schema files (`otwarp/scene/schema/`), the reader, the author, the parameters of `Simulation` and `docs/scene.md`
all follow this table; tests hold them to it. Values in USD are SI; geometry (radii, transforms) is in stage units.

`attribute` says what a row is (open it first), `values` takes values from SI units to the internal ones and back.

A new attribute is one row in the file of its prim (`medium`, `traps`, `bodies`, `obstacles`, `task`) and a field of the
dataclass that it fills; `make schema` writes the rest. A built-in force with scene attributes needs its rows alone, in
`forces.FORCES`, and no field:

    Attribute(
        "ot:body:externalForce", (0.0, 0.0, 0.0), "force", "[0, 1e-6]", optional=True, field="forces.external_force",
        per_world=("external_force",), doc="Constant force in world coordinates."
    )

It is read into `Body.forces["external_force"]` [pN] where a robot (or, as `ot:cell:externalForce`, a cell) authors it,
written by `SceneBuilder` where a body has it, checked (three finite numbers, the range for their length), documented,
and `Simulation(parameters={"external_force": …})` takes it for every world and body, `(1|W, 1|B, 3)`; the model finds
all in `otwarp.simulation.packing.parameters.scene_values`. A default that is one number makes it a scalar.
"""

from __future__ import annotations

from otwarp.scene.vocabulary.attribute import Attribute, Schema
from otwarp.scene.vocabulary.bodies import BODY, CELL, ROD, SPHERE
from otwarp.scene.vocabulary.medium import FLOW, SCENE
from otwarp.scene.vocabulary.obstacles import OBSTACLE
from otwarp.scene.vocabulary.task import CAMERA, GOAL
from otwarp.scene.vocabulary.traps import TRAP, TRAP_LAW

SCHEMAS: tuple[Schema, ...] = (SCENE, TRAP, TRAP_LAW, BODY, SPHERE, ROD, CELL, OBSTACLE, FLOW, CAMERA, GOAL)
"""All schemas, in the order of the documentation."""

__all__ = [
    "BODY",
    "CAMERA",
    "CELL",
    "FLOW",
    "GOAL",
    "OBSTACLE",
    "ROD",
    "SCENE",
    "SCHEMAS",
    "SPHERE",
    "TRAP",
    "TRAP_LAW",
    "Attribute",
    "Schema",
]
