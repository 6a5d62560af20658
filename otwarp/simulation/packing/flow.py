"""The background flow as kernels read it, and how fast it is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
import warp as wp

from otwarp.kernels.core.types import FlowData
from otwarp.scene import Flow, Scene
from otwarp.scene.flow_grid import FlowGrid
from otwarp.scene.flow_profile import PROFILES, field_of
from otwarp.scene.transforms import multiply, rotation_matrix
from otwarp.simulation.packing.arrays import Place, device_array, device_rows

_QUARTER_ABOUT_X = np.array([0.5**0.5, 0.0, 0.0, 0.5**0.5])


def flows(scene: Scene, values: Mapping[str, np.ndarray]) -> bool:
    """Whether there is a flow that moves anything in any world."""
    flow = scene.flow
    if flow is None:
        return False
    return bool(np.any(strengths(flow, values)))


def strengths(flow: Flow, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """(1|W,) what the velocity of a flow is proportional to, of data its largest velocity."""
    of = PROFILES[flow.kind].strength
    return np.abs(values[f"flow_{of}"]) if of else np.array([field_of(flow).fastest])


def pack_flow(scene: Scene, speed: np.ndarray, shear_rate: np.ndarray, device: Place) -> Annotated[Any, FlowData]:
    """Flow constants; arrays of length 0 without a flow.

    Args:
        speed, shear_rate: (1|W,) parameters [µm/s, 1/s].
    """
    flow = scene.flow
    data, vec3 = device.typed(FlowData)(), device.typed(wp.vec3)
    empty = np.zeros(0)
    data.speed = device_rows(speed if flow else empty, wp.float32, device)
    data.shear_rate = device_rows(shear_rate if flow else empty, wp.float32, device)
    nodes = np.zeros((0, 3, 3))
    if flow is not None:
        turn = np.array(flow.orientation)
        section = PROFILES[flow.kind].section(flow)
        if section.turned:
            turn = multiply(turn, _QUARTER_ABOUT_X)
        data.half_height, data.half_width, data.drive = section.half_height, section.half_width, section.drive
        data.origin, data.rotation = vec3(*flow.origin), device.typed(wp.quat)(*turn)
        if flow.field is not None:
            nodes = _nodes(flow.field)
            data.low = vec3(*flow.field.low)
            data.per_spacing = vec3(*(1.0 / np.array(flow.field.spacing)))
            data.last = vec3(*(np.array(flow.field.nodes) - 1.0))
            data.repeat = vec3(*_repeats(scene, flow, flow.field))
    data.node = device_array(nodes, wp.vec3, device, ndim=2)
    return data


def _nodes(field: FlowGrid) -> np.ndarray:
    """(nodes, 3, 3) velocity, half curl and a sixth of the Laplacian, z fastest."""
    return np.stack([field.velocity, 0.5 * field.curl, field.laplacian / 6.0], axis=3).reshape(-1, 3, 3)


def _repeats(scene: Scene, flow: Flow, field: FlowGrid) -> np.ndarray:
    """(3,) cells of a field after which it repeats, along its own axes; that it does `Scene.check` has seen."""
    closed = np.array(scene.settings.period) > 0.0
    along = np.abs(rotation_matrix(np.array(flow.orientation))).T @ closed > 0.5
    return np.where(along, np.array(field.nodes) - 1.0, 0.0)
