"""Actions from outside: what is accepted, and how it comes to the device."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from otwarp.envs.task import Task
from otwarp.errors import InputError


def is_tensor(values: Any) -> bool:
    """Whether it is a tensor of torch."""
    return type(values).__module__.partition(".")[0] == "torch"


def read_action(given: Any) -> np.ndarray:
    """An action on the host as an array of NumPy; what is none has the type of objects.

    Raises:
        InputError: A tensor of torch that is elsewhere, or sparse.
    """
    if is_tensor(given):
        if given.device.type != "cpu":
            raise InputError(f"action is on {given.device}; allowed: an array of NumPy, or a tensor on cpu")
        given = _plain(given)
    try:
        return np.asarray(given)
    except (TypeError, ValueError):
        return np.array(None)


def write_actions(task: Task, given: Any, out: Any) -> None:
    """Write the actions of all environments, nothing unless all are accepted.

    Args:
        task: Whose they are.
        given: (N, A) floating-point numbers within ±1, cut off there; (N) whole numbers where the task has choices; an
            array, or a tensor of torch on the device of the environments.
        out: (N, A) float32.

    Raises:
        InputError: Another shape, type or device, a sparse tensor, or a number that is not finite or chooses nothing.
    """
    if is_tensor(given):
        _write_tensor(task, given, out)
        return
    values = read_action(given)
    if task.choices:
        rows = np.array(task.choices, dtype=np.float32)
        check(values.dtype.kind in "iu", str(values.dtype), values.shape, (out.shape[0],), "whole numbers")
        outside = (values < 0) | (values >= len(rows))
        if np.any(outside):
            raise InputError(f"action is {values[outside][0]}; allowed: 0 to {len(rows) - 1}")
        values = rows[values]
    else:
        check(values.dtype.kind == "f", str(values.dtype), values.shape, out.shape, "floating-point numbers")
        check_finite(values)
        values = values.clip(-1.0, 1.0)  # as the device does; float32 holds no 1e300
    if out.device.is_cpu:
        out.numpy()[...] = values
    else:
        out.assign(np.ascontiguousarray(values, dtype=np.float32))


def check(good: bool, dtype: str, shape: tuple[int, ...], wanted: tuple[int, ...], kind: str) -> None:
    """Refuse actions of another type or shape.

    Raises:
        InputError: They are.
    """
    if not good or tuple(shape) != tuple(wanted):
        raise InputError(f"actions are {dtype} of shape {tuple(shape)}; allowed: {kind} of shape {tuple(wanted)}")


def check_finite(values: np.ndarray) -> None:
    """Refuse floating-point numbers of actions that are not finite.

    Raises:
        InputError: The first that is not, and where it stands.
    """
    bad = ~np.isfinite(values)
    if np.any(bad):
        at = tuple(int(i) for i in np.argwhere(bad)[0])
        where = at[0] if len(at) == 1 else at
        raise InputError(f"action {where} is {values[at]}; allowed: finite numbers, of which those within ±1 count")


def _plain(given: Any) -> Any:
    """A tensor without its gradient; numbers of fewer bits, which NumPy may not have, as float32.

    Raises:
        InputError: It is sparse.
    """
    import torch

    if given.layout is not torch.strided:
        layout = str(given.layout).removeprefix("torch.")
        raise InputError(f"actions are a tensor of layout {layout}; allowed: strided, as to_dense() makes it")
    given = given.detach()
    return given.float() if given.is_floating_point() and given.element_size() < 4 else given


def _write_tensor(task: Task, given: Any, out: wp.array) -> None:
    import torch

    view = wp.to_torch(out)
    if given.device != view.device:
        raise InputError(f"actions are on {given.device}; allowed: {view.device}, where the environments are")
    given = _plain(given)
    if task.choices:
        whole = not (given.is_floating_point() or given.is_complex() or given.dtype is torch.bool)
        check(whole, str(given.dtype), tuple(given.shape), (out.shape[0],), "whole numbers")
        rows = torch.tensor(task.choices, dtype=torch.float32, device=view.device)
        if given.numel() and (bool((given < 0).any()) or bool((given >= len(rows)).any())):
            raise InputError(f"an action is none of the choices; allowed: 0 to {len(rows) - 1}")
        given = rows[given.long()]
    check(given.dtype.is_floating_point, str(given.dtype), tuple(given.shape), out.shape, "floating-point numbers")
    if not bool(torch.isfinite(given).all()):
        raise InputError("an action is not finite; allowed: finite numbers, of which those within ±1 count")
    view.copy_(given)
