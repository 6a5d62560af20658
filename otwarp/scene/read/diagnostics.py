"""What USD finds wrong while a stage is read: kept off stderr, and reported in one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from pxr import Tf, UsdUtils

from otwarp.errors import InputError

USD_ERRORS = (Tf.ErrorException, RuntimeError, TypeError, OverflowError, MemoryError, UnicodeDecodeError)
"""What calls into USD raise on what a file holds."""


@contextmanager
def quiet_usd() -> Iterator[None]:
    """Keep USD's own warnings and errors off stderr."""
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    finally:
        del delegate  # with what it holds, which may quote bytes of the file that are no text


@contextmanager
def reading(file: str) -> Iterator[None]:
    """Read in silence; what USD finds wrong by itself, in values that it combines natively, becomes one line.

    Raises:
        InputError: Naming `file`.
    """
    with quiet_usd():
        try:
            yield
        except (Tf.ErrorException, UnicodeDecodeError) as error:
            raise InputError(f"{file}: contents = {usd_reason(error)}: must be a valid stage") from None


def usd_reason(error: object) -> str:
    """USD's own account of an error as one line, without its source locations."""
    try:
        text = str(error)
    except UnicodeDecodeError as undecodable:  # it quotes the file's own bytes
        text = bytes(undecodable.object).decode("utf-8", "replace")
    if isinstance(error, Tf.ErrorException) and "'" in text:
        text = text.split(" : '", 1)[-1].strip().splitlines()[0].rstrip("'")
    return " ".join(text.split())[:300]
