"""The four evaluations of a force table: NumPy is the reference, the servo, Warp and a CPU's vectors agree with it."""

import functools
import math

import numpy as np
import pytest
import warp as wp

from otwarp.haptics.force.law import TableLaw
from otwarp.kernels.core.precision import kernel_module, typed
from otwarp.kernels.core.table_data import ForceTableData
from otwarp.kernels.core.types import Aim, vec6
from otwarp.kernels.cpu.rigid_block import FEW_SPHERES
from otwarp.kernels.cpu.table_block import table_wrench_term
from otwarp.laws.table import STENCILS
from otwarp.optics import ForceTable
from otwarp.optics.table import major_axis
from otwarp.simulation.packing.arrays import Place
from otwarp.simulation.packing.optics import TrapOptics, pack_tables
from tests.reference.tables import BEAMS, made_up_table, probe_points

LAYERS = (1, 2, 3)
INTERPOLATIONS = ("bilinear", "bicubic")

ROUNDING = 5e-6
"""float32 interpolation relative to the largest force: cell offsets of 1e-6 of a cell, some twenty operations."""

DOUBLE_ROUNDING = 1e-13
"""The same in float64: offsets of 1e-14 of a cell, in a random field that changes by its size from node to node."""


@functools.cache
def case(interpolation: str, layers: int) -> tuple[ForceTable, np.ndarray, np.ndarray]:
    """A table, places in its beam's frame, and the forces per mW of the reference there."""
    table = made_up_table(BEAMS[layers - 1], interpolation, layers)
    place = probe_points(np.random.default_rng(layers), 4000, table.cutoff)
    # the reference turns the polarization's major axis to x by itself; the others are given the turned frame
    turn = major_axis(table.beam)
    c, s = math.cos(turn), math.sin(turn)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    force = table.force(place.astype(float) @ rotation.T) @ rotation * table.beam.force_scale
    assert np.abs(force).max() > 1.0
    return table, place, force


def packed(interpolation: str, device: str, precision: str) -> tuple[ForceTableData, wp.array, wp.array]:
    """The tables of all layers, one after another, and what a trap reads first of each."""
    tables = tuple(case(interpolation, layers)[0] for layers in LAYERS)
    pairs = np.arange(len(tables), dtype=np.int32)[:, None]
    optics = TrapOptics((), tables, pairs, np.zeros(0, dtype=int))
    return pack_tables(optics, [0.0] * len(tables), Place(wp.get_device(device), precision))


def check(found: np.ndarray, interpolation: str, layers: int, rounding: float) -> None:
    table, place, force = case(interpolation, layers)
    error = np.abs(found - force).max(axis=1) / np.abs(force).max()
    assert error.max() < rounding
    np.testing.assert_array_equal(found[np.linalg.norm(place, axis=1) > table.cutoff * 1.0001], 0.0)


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize("layers", LAYERS)
def test_servo(interpolation, layers):
    table, place, _ = case(interpolation, layers)
    law = TableLaw.of(table)
    check(np.array([law.beam_force(*p) for p in place.astype(float).tolist()]), interpolation, layers, DOUBLE_ROUNDING)


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_warp(interpolation, precision, device):
    term = kernel_module("optics.force_table", precision).table_term
    one, two, three = (term(interpolation, layers) for layers in LAYERS)
    data, *_ = packed(interpolation, device, precision)
    tables_type, vec3 = typed(ForceTableData, precision), typed(wp.vec3, precision)

    @wp.kernel(module="unique", enable_backward=False)
    def probe(tables: tables_type, layers: int, place: wp.array(dtype=vec3), out: wp.array(dtype=vec3)):
        i = wp.tid()
        p = place[i]
        finest = tables.level[tables.level_start[layers - 1]]
        if layers == 1:
            out[i] = one(tables, 0, finest, p[0], p[1], p[2])
        if layers == 2:
            out[i] = two(tables, 1, finest, p[0], p[1], p[2])
        if layers == 3:
            out[i] = three(tables, 2, finest, p[0], p[1], p[2])

    for layers in LAYERS:
        place = wp.array(case(interpolation, layers)[1], dtype=vec3, device=device)
        out = wp.zeros_like(place)
        wp.launch(probe, dim=len(place), inputs=[data, layers, place, out], device=device)
        check(out.numpy(), interpolation, layers, ROUNDING if precision == "float32" else DOUBLE_ROUNDING)


def test_vectors_of_a_cpu():
    """One sphere at its body's reference point, one trap at the origin that travels along +Z."""
    data, nodes, grid = packed("bilinear", "cpu", "float32")
    one, two, three = (table_wrench_term(1, layers, False) for layers in LAYERS)

    @wp.struct
    class Setting:
        spheres: wp.uint64
        aims: wp.uint64
        trapped: wp.array(dtype=wp.vec4)
        kind: wp.array(dtype=wp.int32)
        axis: wp.array(dtype=wp.vec3)
        side: wp.array(dtype=wp.vec3)
        nodes: wp.array2d(dtype=wp.vec4i)
        grid: wp.array2d(dtype=wp.vec4)

    @wp.kernel(module="unique", enable_backward=False)
    def probe(g: Setting, t: ForceTableData, layers: int, place: wp.array(dtype=wp.vec3), out: wp.array(dtype=wp.vec3)):
        i = wp.tid()
        p = place[i]
        r = wp.identity(n=3, dtype=float)
        wrench = vec6()
        if layers == 1:
            wrench = one(
                g.spheres, g.aims, p, r, g.trapped, g.kind, 0, 1, g.axis, g.side, g.nodes, g.grid, t.node,
                t.level_start, t.level,
            )  # fmt: skip
        if layers == 2:
            wrench = two(
                g.spheres, g.aims, p, r, g.trapped, g.kind, 0, 1, g.axis, g.side, g.nodes, g.grid, t.node,
                t.level_start, t.level,
            )  # fmt: skip
        if layers == 3:
            wrench = three(
                g.spheres, g.aims, p, r, g.trapped, g.kind, 0, 1, g.axis, g.side, g.nodes, g.grid, t.node,
                t.level_start, t.level,
            )  # fmt: skip
        out[i] = wp.vec3(wrench[0], wrench[1], wrench[2])

    def array(values: list, dtype: type, ndim: int = 1) -> wp.array:
        return wp.array(values, dtype=dtype, device="cpu", ndim=ndim)

    aim = Aim()
    aim.power, aim.reach2 = 1.0, 1e6
    setting, offsets, aims = Setting(), array([0.0] * 3 * FEW_SPHERES, wp.float32), array([aim], Aim)
    setting.spheres, setting.aims = offsets.ptr, aims.ptr
    setting.trapped, setting.kind = array([[0.0] * 4], wp.vec4), array([0], wp.int32)
    setting.axis, setting.side = array([[0.0, 0.0, 1.0]], wp.vec3), array([[1.0, 0.0, 0.0]], wp.vec3)
    for layers in LAYERS:
        setting.nodes, setting.grid = nodes[layers - 1 : layers], grid[layers - 1 : layers]
        place = array(case("bilinear", layers)[1].tolist(), wp.vec3)
        out = wp.zeros_like(place)
        wp.launch(probe, dim=len(place), inputs=[setting, data, layers, place, out], device="cpu")
        check(out.numpy(), "bilinear", layers, ROUNDING)


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_weights_share_out_one(interpolation):
    """They sum to 1 and reproduce straight lines: Σ w = 1, Σ w·node = t; floats and arrays have the same bits."""
    first, weights = STENCILS[interpolation]
    t = np.linspace(0.0, 1.0, 23)
    nodes = first + np.arange(len(weights(0.0)))
    np.testing.assert_allclose(sum(weights(t)), 1.0, rtol=1e-15)
    np.testing.assert_allclose(sum(w * n for w, n in zip(weights(t), nodes, strict=True)), t, atol=1e-15)
