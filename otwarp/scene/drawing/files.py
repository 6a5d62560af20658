"""Where the stage of a scene or of a recorded run lies."""

from __future__ import annotations

from pathlib import Path

from otwarp.errors import InputError

RUN_LAYER = "run.usda"
"""Root layer of a recorded run, in its folder."""


def stage_file(path: str | Path) -> Path:
    """A stage itself, or the `run.usda` of the folder of a recorded run.

    Raises:
        InputError: No run in the folder.
    """
    path = Path(path)
    if not path.is_dir():
        return path
    if not (path / RUN_LAYER).is_file():
        raise InputError(f"{path}: no {RUN_LAYER} in this folder; a USD stage or a run folder is wanted")
    return path / RUN_LAYER
