"""Writes layers, whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from pxr import Sdf, Tf

from otwarp.errors import InputError
from otwarp.files import FULL, written
from otwarp.scene.read.diagnostics import usd_reason


def export_layer(layer: Sdf.Layer, path: Path) -> Path:
    """Write a layer to a file.

    Raises:
        InputError: Wrong ending, or the file cannot be written.
        OSError: The disk is full; it names `path`.
    """
    if path.suffix not in (".usda", ".usdc", ".usd"):
        raise InputError(f"{path}: suffix = {path.suffix or '(none)'}: must be one of .usda, .usdc, .usd")
    if not path.parent.is_dir():  # USD would make it
        raise InputError(f"{path}: cannot be written: {path.parent} is no folder; must be in a writable folder")
    with written(path, str(path)) as part:
        try:
            if not layer.Export(str(part)):
                raise InputError(f"{path}: cannot be written: must be in a writable folder")
        except Tf.ErrorException as error:
            for number in FULL:  # USD says so in words alone
                if os.strerror(number) in str(error):
                    raise OSError(number, os.strerror(number)) from None
            reason = usd_reason(error)
            raise InputError(f"{path}: cannot be written ({reason}); must be in a writable folder") from None
    return path
