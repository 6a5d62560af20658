"""Launches that are made again and again with nearly the same arguments: packed once, then replayed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import warp as wp


class RecordedLaunch:
    """A launch of which only the size and the last arguments change from call to call.

    `wp.launch` packs all arguments anew, which takes five times as long as replaying and more than ten steps of a bead.

    Args:
        kernel: What is launched.
        device: Where.
        inputs: The first arguments. Arrays in them are kept alive.
        how: Further arguments of `wp.launch`.
    """

    def __init__(self, kernel: wp.Kernel, device: wp.Device, inputs: Sequence[Any], **how: Any):
        self.kernel, self.device, self.inputs, self.how = kernel, device, list(inputs), how
        self._command: Any = None
        self._dim: int | tuple[int, int] = -1
        self._last = ()

    def __call__(self, dim: int | tuple[int, int], *last: Any) -> None:
        """Launch over `dim` threads with the `last` arguments, as many in each call."""
        if self._command is None:
            how = {"dim": dim, "inputs": [*self.inputs, *last], "device": self.device, **self.how}
            self._command = wp.launch(self.kernel, record_cmd=True, **how)
        elif dim != self._dim:
            self._command.set_dim(dim)
        for n, (value, before) in enumerate(zip(last, self._last, strict=False), start=len(self.inputs)):
            if value is not before:
                self._command.set_param_at_index(n, value)
        self._dim, self._last = dim, last
        self._command.launch()
