"""Choosing a device, and keeping Warp's own messages away from the user."""

from __future__ import annotations

import warp as wp

from otwarp.errors import InputError


def pick_device(name: str | wp.Device | None) -> wp.Device:
    """The named device, or for None the first CUDA device if there is one, else the CPU.

    Raises:
        InputError: No such device; the message lists those there are.
    """
    wp.config.log_level = max(wp.config.log_level, wp.LOG_WARNING)
    wp.init()
    if isinstance(name, wp.Device):
        return name
    known = [d.alias for d in wp.get_devices()]
    if name is None:
        return wp.get_device("cuda:0" if "cuda:0" in known else "cpu")
    if name not in known and name != "cuda":
        raise InputError(f"device is {name!r}; allowed: {', '.join(known)}")
    try:
        return wp.get_device(name)
    except (RuntimeError, ValueError) as error:
        raise InputError(f"device is {name!r}; allowed: {', '.join(known)}") from error
