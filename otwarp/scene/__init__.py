"""The scene room: what a USD stage says, read, authored, validated, recorded and drawn; the only room that knows `pxr`.

What users need is offered here. Importing this package loads no `pxr`, yet the `ot:` schemas are known to every stage
opened afterwards: before USD starts, through its plugin path; when USD is already there, through its plugin registry.

    stage ──► read ──► description, scene ──► simulation …          description ──► write ──► stage
      └─────► drawing ──► preview, teleop's page                    frames ──► recording ──► run.usda

| room | what it is | open first |
|---|---|---|
| `description`, `track`, `scene` | plain frozen dataclasses in µm, s, pN, mW, K: neither USD nor Warp | `description` |
| `digest` | content hash of a scene, for checkpoints and recordings | `digest` |
| `keywords` | misspelt keywords, with the nearest name | `keywords` |
| `finding` | what is wrong or odd in a scene | `finding` |
| `obstacle_shapes` | the table of shapes: prim, distance, outline | `obstacle_shapes` |
| `flow_profile`, `flow_grid` | the table of flow profiles: velocity, bounds; a flow as data | `flow_profile` |
| `transforms`, `meshes`, `period` | rigid transforms, triangle meshes and space that repeats, NumPy | `transforms` |
| `vocabulary` | the one table of `ot:` attributes, which all the rest follows | `vocabulary/__init__` |
| `schema` | the USD schema files, written from the table | `schema/generate` |
| `check` | what every description is held to, from a file or from Python |
| `read` | stage → fields of a `Scene`, and `validate` | `read/load` |
| `plausibility` | scene → what it hardly means: slips of units, traps that hold nothing | `plausibility/__init__` |
| `appearance` | colours, materials and lights; what a stage lacks of them | `appearance/missing` |
| `write` | description → stage | `write/builder` |
| `export` | a stage or a run → one USD file in metres or with meshes, or glTF | `export/stage` |
| `recording` | frames of a run → `run.usda` | `recording/usd` |
| `drawing` | stage → shapes, lights and camera of a picture | `drawing/drawables` |
"""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

from otwarp.laws import TrapLaw
from otwarp.lazy import lazy_names
from otwarp.scene.description import (
    IDENTITY,
    OPTICAL_MODELS,
    Body,
    Camera,
    Flow,
    Goal,
    Material,
    Medium,
    Obstacle,
    Quat,
    Rod,
    Settings,
    Sphere,
    Trap,
    Vec3,
)
from otwarp.scene.finding import Finding
from otwarp.scene.scene import Scene
from otwarp.scene.schema import SCHEMA_FOLDER, register
from otwarp.scene.track import Track

if TYPE_CHECKING:
    from otwarp.scene.export.gltf import export_gltf
    from otwarp.scene.export.stage import export_flattened, export_in_metres, export_stage
    from otwarp.scene.read.validate import Report, validate
    from otwarp.scene.write.body_file import write_body
    from otwarp.scene.write.builder import SceneBuilder

__all__ = [
    "IDENTITY",
    "OPTICAL_MODELS",
    "SCHEMA_FOLDER",
    "Body",
    "Camera",
    "Finding",
    "Flow",
    "Goal",
    "Material",
    "Medium",
    "Obstacle",
    "Quat",
    "Report",
    "Rod",
    "Scene",
    "SceneBuilder",
    "Settings",
    "Sphere",
    "Track",
    "Trap",
    "TrapLaw",
    "Vec3",
    "export_flattened",
    "export_gltf",
    "export_in_metres",
    "export_stage",
    "validate",
    "write_body",
]

__getattr__, _ = lazy_names(
    __name__,
    {
        "export.gltf": ("export_gltf",),
        "export.stage": ("export_flattened", "export_in_metres", "export_stage"),
        "read.validate": ("Report", "validate"),
        "write.body_file": ("write_body",),
        "write.builder": ("SceneBuilder",),
    },
)


def __dir__() -> list[str]:
    return sorted(__all__)


def _announce_schemas() -> None:
    """Make the `ot:` schemas known to USD, without importing it when nobody has yet."""
    if "pxr" in sys.modules:
        register()
        return
    # USD reads this variable once, when it is first imported; child processes (usdview) profit as well.
    known = os.environ.get("PXR_PLUGINPATH_NAME", "")
    if str(SCHEMA_FOLDER) not in known.split(os.pathsep):
        os.environ["PXR_PLUGINPATH_NAME"] = os.pathsep.join(filter(None, [known, str(SCHEMA_FOLDER)]))


_announce_schemas()
