"""The one table of the scene vocabulary: every `ot:` attribute, its field, dimension, default and allowed range.

The schema files (`otwarp/scene/schema/`), the reader, the author and `docs/scene.md` all follow this table; tests
hold them to it. Values in USD are SI; geometry (radii, transforms) is in stage units.
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
