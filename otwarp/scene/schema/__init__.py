"""The codeless USD schemas: `plugInfo.json` and `generatedSchema.usda` (written by `generate`), and their registration.

`python -m otwarp.scene.schema` rewrites both and the tables of `docs/scene.md` from `otwarp.scene.vocabulary`.
"""

from __future__ import annotations

from pathlib import Path

SCHEMA_FOLDER = Path(__file__).resolve().parent
"""Folder of `plugInfo.json` and `generatedSchema.usda`; add it to PXR_PLUGINPATH_NAME for other USD programs."""


def register() -> None:
    """Register the `ot:` schemas with USD; harmless when done before, useless once its schema registry is built."""
    from pxr import Plug

    Plug.Registry().RegisterPlugins(str(SCHEMA_FOLDER))
