"""Writes layers atomically."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from pxr import Sdf, Tf

from otwarp.errors import InputError
from otwarp.files import FULL
from otwarp.scene.read.diagnostics import usd_reason


def export_layer(layer: Sdf.Layer, path: Path) -> Path:
    """Write a layer to `path` through a temporary file in the same folder, so that no partial file is ever seen.

    Raises:
        InputError: Wrong ending, or the file cannot be written.
        OSError: The disk is full; it names `path`.
    """
    if path.suffix not in (".usda", ".usdc", ".usd"):
        raise InputError(f"{path}: suffix = {path.suffix or '(none)'}: must be one of .usda, .usdc, .usd")
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}.", suffix=path.suffix)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}; must be in a writable folder") from None
    os.close(handle)
    temporary = Path(name)
    try:
        if not layer.Export(name):
            raise InputError(f"{path}: cannot be written: must be in a writable folder")
        temporary.chmod(0o644)
        temporary.replace(path)
    except Tf.ErrorException as error:
        for number in FULL:  # USD says so in words alone
            if os.strerror(number) in str(error):
                raise OSError(number, os.strerror(number), str(path)) from None
        raise InputError(f"{path}: cannot be written ({usd_reason(error)}); must be in a writable folder") from None
    finally:
        temporary.unlink(missing_ok=True)
    return path
