"""The calibration of a microscope as a file: versioned JSON, every number with its interval."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from otwarp.errors import InputError
from otwarp.files import written
from otwarp.vision.calibration.measured import Measured

FORMAT, VERSION = "otwarp vision calibration", 1
NAMES = ("pixel", "grid_angle", "pixel_by_stage", "stage_angle", "trap_plane", "depth_scale")
"""What a calibration may hold."""


@dataclass(frozen=True)
class Calibration:
    """What is known of a microscope.

    Attributes:
        results: By name of `NAMES`.
        source: What was looked at: targets and optics.
    """

    results: Mapping[str, Measured]
    source: Mapping[str, Any] = field(default_factory=dict)

    def save(self, file: str | Path) -> Path:
        """Write it.

        Raises:
            InputError: It cannot be written.
        """
        path = Path(file)
        said = {"format": FORMAT, "version": VERSION, "source": dict(self.source),
                "results": {name: found.described() for name, found in self.results.items()}}  # fmt: skip
        with written(path, f"--out {path}") as part:
            part.write_text(json.dumps(said, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        return path


def load_calibration(file: str | Path) -> Calibration:
    """Read one.

    Raises:
        InputError: It is none, or of another version.
    """
    path = Path(file)
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error}); allowed: what otwarp vision calibrate wrote") from None
    if not isinstance(said, dict) or said.get("format") != FORMAT:
        raise InputError(f"{path}: is no calibration; allowed: what otwarp vision calibrate wrote")
    if said.get("version") != VERSION:
        raise InputError(f"{path}: version = {said.get('version')!r}; allowed: {VERSION}, as this otwarp writes it")
    try:
        results = {name: Measured.read(one) for name, one in said["results"].items() if name in NAMES}
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"{path}: results cannot be read ({error!r}); allowed: what otwarp vision calibrate wrote"
        ) from None
    return Calibration(results, said.get("source", {}))
