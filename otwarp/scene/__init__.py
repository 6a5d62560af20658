"""The scene room: what a USD stage says, read, authored and validated. The only room that knows `pxr`.

Importing this package loads no `pxr`, yet the `ot:` schemas are known to every stage opened afterwards: before USD
starts, through its plugin path; when USD is already there, through its plugin registry.
"""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, Any

from otwarp.laws import TrapLaw
from otwarp.scene.description import (
    Body,
    Camera,
    Flow,
    Goal,
    Material,
    Medium,
    Obstacle,
    Rod,
    Scene,
    Settings,
    Sphere,
    Track,
    Trap,
)
from otwarp.scene.schema import SCHEMA_FOLDER, register

if TYPE_CHECKING:
    from otwarp.scene.read.load import load_scene
    from otwarp.scene.write.builder import SceneBuilder
    from otwarp.scene.write.export import export_in_metres

__all__ = [
    "SCHEMA_FOLDER",
    "Body",
    "Camera",
    "Flow",
    "Goal",
    "Material",
    "Medium",
    "Obstacle",
    "Rod",
    "Scene",
    "SceneBuilder",
    "Settings",
    "Sphere",
    "Track",
    "Trap",
    "TrapLaw",
    "export_in_metres",
    "load_scene",
]

_LAZY = {"SceneBuilder": "write.builder", "export_in_metres": "write.export", "load_scene": "read.load"}


def _announce_schemas() -> None:
    """Make the `ot:` schemas known to USD, without importing it when nobody has yet."""
    if "pxr" in sys.modules:
        register()
        return
    # USD reads this variable once, when it is first imported; child processes (usdview) profit as well.
    known = os.environ.get("PXR_PLUGINPATH_NAME", "")
    if str(SCHEMA_FOLDER) not in known.split(os.pathsep):
        os.environ["PXR_PLUGINPATH_NAME"] = os.pathsep.join(filter(None, [known, str(SCHEMA_FOLDER)]))


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import importlib

    value = getattr(importlib.import_module(f"{__name__}.{_LAZY[name]}"), name)
    globals()[name] = value
    return value


_announce_schemas()
