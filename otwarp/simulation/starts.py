"""How worlds start anew, or elsewhere: which of them, where, and with which trials, from what a user gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import warp as wp

from otwarp.device import empty
from otwarp.errors import InputError
from otwarp.kernels.core.precision import kernel_module
from otwarp.kernels.core.types import StateData
from otwarp.simulation.model import Model
from otwarp.simulation.packing.arguments import numbers
from otwarp.simulation.packing.arrays import device_array, device_rows, device_view, filled

_VECTORS = {"position": wp.vec3, "orientation": wp.quat}


@dataclass(frozen=True, eq=False)
class Starts:
    """What `restart` reads.

    Attributes:
        chosen: (W) int32, not 0 for the worlds that start anew.
        state: `StateData` with (1|W, …) rows.
        number: (W) uint32 trials that they run; (0): the next of each.
    """

    chosen: wp.array
    state: Annotated[Any, StateData]
    number: wp.array

    @classmethod
    def of_scene(cls, model: Model) -> Starts:
        """All worlds as the scene has them, in the next trial of each."""
        place, f = model.place, model.features
        state = place.typed(StateData)()
        turns = model.start_orientation() if f.rigid else np.zeros((0, 4))
        foci = model.values["trap_position"] if f.speed_limits else np.zeros((1, 0, 3))
        start, image = model.start_position(), np.zeros((0, 3), dtype=np.int32)
        if f.periodic:
            start, image = model.in_cell(start)
        state.position = device_array(start[None], wp.vec3, place, ndim=2)
        state.image = device_array(image[None], wp.vec3i, place, ndim=2)
        state.orientation = device_array(turns[None], wp.quat, place, ndim=2)
        state.trap_position = device_rows(foci, wp.vec3, place, ndim=2)
        everyone = filled((model.worlds,), 1, wp.int32, model.device)
        return cls(everyone, state, empty(0, wp.uint32, model.device))


def pose_rows(model: Model, name: str, values: Any) -> np.ndarray:
    """(W, B, 3) positions [µm] or (W, B, 4) unit quaternions, from what a user gave for all worlds or for each.

    Raises:
        InputError: A wrong shape, a number that is not finite, a quaternion of length 0, or an orientation where no
            body rotates.
    """
    values = numbers(f"state {name}", values)
    full = (model.worlds, len(model.scene.bodies), 3 if name == "position" else 4)
    _check_turns(model, name)
    if values.shape not in (full, full[1:]):
        raise InputError(f"state {name} has shape {values.shape}; allowed: {full[1:]} or {full}")
    bad = ~np.isfinite(values)
    if np.any(bad):
        raise InputError(f"state {name} has the value {values[bad][0]:g}; allowed: finite numbers")
    if name == "orientation":
        length = np.linalg.norm(values, axis=-1, keepdims=True)
        if np.any(length == 0.0):
            raise InputError("state orientation has a quaternion of length 0; allowed: any other length")
        values = values / length
    return np.broadcast_to(values, full)


def _check_turns(model: Model, name: str) -> None:
    """Raise an `InputError` for orientations where no body rotates."""
    if name == "orientation" and not model.features.rigid:
        raise InputError("state orientation cannot be set, no body rotates; allowed: position alone")


def starts_of(model: Model, origin: Starts, worlds: Any, poses: Mapping[str, Any], number: Any) -> Starts:
    """What a user gave to `Simulation.reset`, which says what is allowed, on the device.

    Args:
        origin: What counts where nothing is given.
        poses: `position` and `orientation`, or None.

    Raises:
        InputError: A wrong shape, type, device or value.
    """
    chosen = origin.chosen if worlds is None else _flags(model, worlds)
    trials = origin.number if number is None else _numbers(model, number)
    if all(given is None for given in poses.values()):
        return Starts(chosen, origin.state, trials)
    state = model.place.typed(StateData)()
    state.trap_position, state.image = origin.state.trap_position, origin.state.image
    if poses["position"] is not None:
        state.image = wp.zeros_like(state.image)
    for name in _VECTORS:
        given = poses[name]
        rows = getattr(origin.state, name) if given is None else _pose(model, name, given)
        setattr(state, name, rows)
    return Starts(chosen, state, trials)


def _pose(model: Model, name: str, values: Any) -> wp.array:
    """(1|W, B) places or orientations."""
    dtype = model.place.typed(_VECTORS[name])
    view = device_view(values, dtype)
    if view is None:
        return device_array(pose_rows(model, name, values), _VECTORS[name], model.place, ndim=2)
    _check_turns(model, name)
    return _on_device(model, f"state {name}", view, dtype, [(n, len(model.scene.bodies)) for n in (1, model.worlds)])


def _on_device(model: Model, name: str, view: wp.array, dtype: Any, shapes: list[tuple[int, ...]]) -> wp.array:
    """An array that the device may read in place.

    Raises:
        InputError: It is another one's, of another type or of another shape.
    """
    if view.device != model.device:
        raise InputError(f"{name} is on {view.device}; allowed: {model.device}, where the simulation is, or the host")
    if view.dtype is not dtype:
        raise InputError(f"{name} has elements of {view.dtype.__name__}; allowed: {dtype.__name__}")
    if view.shape not in shapes:
        raise InputError(f"{name} has shape {view.shape}; allowed: {' or '.join(map(str, dict.fromkeys(shapes)))}")
    return view


def _flags(model: Model, worlds: Any) -> wp.array:
    """(W) int32 flags of the chosen worlds."""
    view, w = device_view(worlds), model.worlds
    if view is not None and view.dtype is wp.bool:
        chosen = _on_device(model, "worlds", view, wp.bool, [(w,)])
        flags = empty(w, wp.int32, model.device)
        kernel = kernel_module("drivers.episodes", model.features.precision).flag_worlds
        wp.launch(kernel, dim=w, inputs=[chosen, flags], device=model.device)
        return flags
    if view is not None:
        return _on_device(model, "worlds", view, wp.int32, [(w,)])
    return device_array(host_flags(worlds, w), wp.int32, model.device)


def host_flags(worlds: Any, count: int) -> np.ndarray:
    """(W) bool of flags, which are of type bool or int32 as on the device, or of indices.

    Raises:
        InputError: Flags of another length, an index of no world, or one that stands there twice, as in flags of
            another type.
    """
    allowed = f"allowed: ({count},) flags of type bool or int32, or indices from 0 to {count - 1}, each once"
    try:
        given = np.atleast_1d(np.asarray(worlds))
    except ValueError:  # rows of unequal length
        given = np.array([None])
    if given.shape == (count,) and given.dtype in (bool, np.int32):
        return given != 0
    if given.size and (given.ndim > 1 or given.dtype.kind not in "iu"):
        raise InputError(f"worlds has shape {given.shape} and type {given.dtype}; {allowed}")
    outside = (given < 0) | (given >= count)
    if np.any(outside):
        raise InputError(f"worlds has the index {given[outside][0]}; {allowed}")
    if len(np.unique(given)) < given.size:
        raise InputError(f"worlds has an index twice; {allowed}")
    return np.isin(np.arange(count), given)


def _numbers(model: Model, number: Any) -> wp.array:
    """(W) trials."""
    view = device_view(number)
    if view is not None:
        return _on_device(model, "number", view, wp.uint32, [(model.worlds,)])
    rows = numbers("number", number)
    bad = (rows < 0) | (rows >= 2**32) | (rows != np.floor(rows))
    if rows.shape != (model.worlds,) or np.any(bad):
        raise InputError(
            f"number is {rows[bad][:1].tolist() or rows.shape}; allowed: ({model.worlds},) whole numbers, 0 to 2³² − 1"
        )
    return device_array(rows, wp.uint32, model.device)
