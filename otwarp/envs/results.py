"""What a period led to, as arrays for whoever steps: NumPy's, copied, or tensors of torch on the same memory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import warp as wp

from otwarp.envs.batch import Batch
from otwarp.errors import InputError

Arrays = Literal["numpy", "torch"]
REWARD = "reward/"
"""Before the names of rewards in the information of a step."""


def reader(arrays: str) -> Callable[[wp.array], Any]:
    """What makes an array of Warp one of NumPy or a tensor.

    Raises:
        InputError: Neither is wanted, or there is no torch.
    """
    if arrays == "numpy":
        return _copier()
    if arrays != "torch":
        raise InputError(f"arrays is {arrays!r}; allowed: numpy, torch")
    try:
        import torch  # noqa: F401
    except ImportError:
        raise InputError("arrays is 'torch', which is not installed; allowed: pip install 'otwarp[vision]'") from None
    return _viewer()


def _copier() -> Callable[[wp.array], np.ndarray]:
    """What copies arrays to the host; of those that are there it keeps the views, which cost more than small copies."""
    views: dict[tuple[Any, ...], np.ndarray] = {}

    def read(array: Any) -> np.ndarray:
        """A copy of the caller's own."""
        if not array.device.is_cpu:
            return array.numpy()
        key = array.ptr, array.shape, array.dtype
        if key not in views:
            views[key] = array.numpy()
        return views[key].copy()

    return read


def _viewer() -> Callable[[wp.array], Any]:
    """What makes tensors on the memory of arrays; it keeps one of each, for making it costs more than another view."""
    views: dict[tuple[Any, ...], Any] = {}

    def view(array: Any) -> Any:
        """A tensor of the caller's own, whose numbers are the array's."""
        key = array.ptr, array.shape, array.dtype
        if key not in views:
            views[key] = wp.to_torch(array)
        return views[key].detach()

    return view


def information(batch: Batch, read: Callable[[wp.array], Any]) -> dict[str, Any]:
    """The rewards of a period one by one, why episodes have ended, and which came to what was wanted."""
    out = batch.verdict
    earned = read(out.earned)
    info = {f"{REWARD}{t.name}": earned[:, n] for n, t in enumerate(batch.task.rewards)}
    info["outcome"], info["success"] = read(out.outcome), read(out.success)
    return info


def blank(batch: Batch) -> dict[str, Any]:
    """The same of worlds that have just started."""
    n = batch.worlds
    info: dict[str, Any] = {f"{REWARD}{t.name}": np.zeros(n, dtype=np.float32) for t in batch.task.rewards}
    return {**info, "outcome": np.zeros(n, dtype=np.int32), "success": np.zeros(n, dtype=bool)}


def masked(info: dict[str, Any], everyone: Any) -> dict[str, Any]:
    """The same with a mask for each entry, as Gymnasium's vector environments have it."""
    return info | {f"_{name}": everyone for name in info}
