"""Regenerate the shipped stages: `python -m scenes.author [FOLDER] [NAME …]`; without arguments, all into scenes/."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

from otwarp.errors import InputError

NAMES = (
    "single_bead",
    "table_trap",
    "transport",
    "robot_hold",
    "force_models",
    "two_trap_dimer",
    "strategy_a",
    "strategy_b",
    "cell_delivery",
    "microfluidic_channel",
    "ten_thousand_cells",
    "teleop_small",
    "navigate",
    "push",
    "hold",
)
FOLDER = Path(__file__).parents[1]


def save(name: str, folder: Path = FOLDER) -> Path:
    """Write one shipped stage as `NAME.usda` into `folder`.

    Raises:
        InputError: No such stage, or the folder cannot be written.
    """
    if name not in NAMES:
        raise InputError(f"scenes.author: NAME = {name}: must be one of {', '.join(NAMES)}")
    return importlib.import_module(f"scenes.author.{name}").build().save(folder / f"{name}.usda")


def main(argv: list[str]) -> int:
    """Write the named stages, or all."""
    folder, names = (Path(argv[0]), argv[1:]) if argv and Path(argv[0]).is_dir() else (FOLDER, argv)
    try:
        for name in names or NAMES:
            print(save(name, folder))
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
