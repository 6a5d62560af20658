"""The force on an operator's hand: eq. 2 over the traps that it moves and the spheres near them, in one call.

The terms are those of the simulation in float64. They are summed in the order of `otwarp.haptics.force.LocalModel`,
which says the same in plain floats; with products and sums kept apart (`fuse_fp`) both have the same bits. The servo
calls the machine code without Warp (`otwarp.haptics.force.compiled`), so that all arguments are addresses and counts.
"""

import functools
from typing import Any

import warp as wp

from otwarp.kernels.core.precision import kernel_module
from otwarp.kernels.core.step_constants import TrapConstants
from otwarp.kernels.core.table_data import ForceTableData, GridLevel
from otwarp.kernels.core.types import TrapData
from otwarp.kernels.optics.trap_laws import isotropic_term, piecewise_ratio, split_term
from otwarp.kernels.optics.traps import LAYER_NAMES, TRAP_TERMS, table_name
from otwarp.laws import local_rows as rows
from otwarp.warp_internals import cpu_code


@wp.func
def felt_ratio(
    d2: float, stiffness: float, threshold2: float, inverse_square: float, offset: float, cutoff2: float
) -> float:
    """f(d)/d of eq. 1 [pN/µm per mW], and 0 at d = 0, where a law without a linear branch has no direction."""
    ratio = piecewise_ratio(d2, stiffness, threshold2, inverse_square, offset, cutoff2)
    if d2 == 0.0:
        ratio = 0.0
    return ratio


TABLES = tuple(table_name(how, layers, False) for how in ("bilinear", "bicubic") for layers in LAYER_NAMES)
FELT: dict[str, wp.Function] = {
    "isotropic": isotropic_term(felt_ratio),
    "split": split_term(felt_ratio),
    **{name: TRAP_TERMS[name].force for name in TABLES},
}
"""Force per mW of every law that an operator can feel, by name."""


def felt_term(models: tuple[str, ...], first: int = 0) -> wp.Function:
    """`force(traps, law, displacement)` of the models from `first` on; `law.model` is an index into them."""
    head = FELT[models[first]]
    if first == len(models) - 1:
        return head
    rest = felt_term(models, first + 1)

    @wp.func
    def force(traps: TrapData, law: TrapConstants, displacement: wp.vec3) -> wp.vec3:
        """Force [pN per mW] of this model, or of one of the rest."""
        f = wp.vec3(0.0)
        if law.model == wp.static(first):
            f += head(traps, law, displacement)
        else:
            f += rest(traps, law, displacement)
        return f

    return force


@wp.func
def vector_at(row: wp.array(dtype=float), first: int) -> wp.vec3:
    """Three neighbouring numbers of a row, from index `first` on, in the row's units."""
    return wp.vec3(row[first], row[first + 1], row[first + 2])


@wp.func
def law_of(row: wp.array(dtype=float)) -> TrapConstants:
    """The constants in a row of laws, see `local_rows.LAW`."""
    law = TrapConstants()
    law.model = int(row[wp.static(rows.LAW.index("model"))])
    law.table = int(row[wp.static(rows.LAW.index("table"))])
    law.axis = vector_at(row, wp.static(rows.LAW.index("axis_x")))
    law.side = vector_at(row, wp.static(rows.LAW.index("side_x")))
    law.up = wp.cross(law.axis, law.side)
    law.stiffness = row[wp.static(rows.LAW.index("stiffness"))]
    law.threshold2 = row[wp.static(rows.LAW.index("threshold2"))]
    law.inverse_square = row[wp.static(rows.LAW.index("inverse_square"))]
    law.offset = row[wp.static(rows.LAW.index("offset"))]
    law.cutoff2 = row[wp.static(rows.LAW.index("cutoff2"))]
    law.axial_stiffness = row[wp.static(rows.LAW.index("axial_stiffness"))]
    law.axial_threshold2 = row[wp.static(rows.LAW.index("axial_threshold2"))]
    law.axial_inverse_square = row[wp.static(rows.LAW.index("axial_inverse_square"))]
    law.axial_offset = row[wp.static(rows.LAW.index("axial_offset"))]
    law.axial_cutoff2 = row[wp.static(rows.LAW.index("axial_cutoff2"))]
    law.reach2 = row[wp.static(rows.LAW.index("reach2"))]
    return law


@wp.func
def glide(sphere: wp.array2d(dtype=float), n: int, alpha: float) -> wp.vec3:
    """Move sphere n towards where it was last published; its place [µm]."""
    now = vector_at(sphere[n], 0)
    then = vector_at(sphere[n], wp.static(rows.SPHERE.index("target_x")))
    now += alpha * (then - now)
    for k in range(3):
        sphere[n, k] = now[k]
    return now


@functools.cache
def local_force_kernel(models: tuple[str, ...]) -> wp.Kernel:
    """Kernel of one thread that sums the forces of laws of these models, names of `FELT`; see `local_rows`."""
    force_at = felt_term(models)

    @wp.kernel(enable_backward=False, module="unique", module_options={"fuse_fp": False})
    def local_force(
        hand_ptr: wp.uint64,
        pull_ptr: wp.uint64,
        pulls: wp.uint64,
        sphere_ptr: wp.uint64,
        spheres: wp.uint64,
        law_ptr: wp.uint64,
        laws: wp.uint64,
        node_ptr: wp.uint64,
        nodes: wp.uint64,
        level_ptr: wp.uint64,
        levels: wp.uint64,
        start_ptr: wp.uint64,
    ):
        """Write the force of the hand's traps [pN] into its row; rows are given by address (`_ptr`) and number."""
        hand = wp.array(ptr=hand_ptr, shape=(wp.static(len(rows.HAND)),), dtype=float)
        pull = wp.array(ptr=pull_ptr, shape=(int(pulls), wp.static(len(rows.PULL))), dtype=float)
        sphere = wp.array(ptr=sphere_ptr, shape=(int(spheres), wp.static(len(rows.SPHERE))), dtype=float)
        law_row = wp.array(ptr=law_ptr, shape=(int(laws), wp.static(len(rows.LAW))), dtype=float)
        tables = ForceTableData()
        tables.node = wp.array(ptr=node_ptr, shape=(int(nodes),), dtype=wp.vec4)
        tables.level = wp.array(ptr=level_ptr, shape=(int(levels),), dtype=GridLevel)
        # the last level of each table ends where the next table starts
        tables.level_start = wp.array(ptr=start_ptr, shape=(int(laws) + 1,), dtype=wp.int32)
        traps = TrapData()
        traps.tables = tables

        carried = vector_at(hand, 0)
        ahead = carried - vector_at(hand, wp.static(rows.HAND.index("published_x")))
        for n in range(int(spheres)):
            glide(sphere, n, hand[wp.static(rows.HAND.index("alpha"))])
        total = wp.vec3(0.0)
        for n in range(int(pulls)):
            one = int(pull[n, wp.static(rows.PULL.index("law"))])
            law = law_of(law_row[one])
            if law.table >= 0:
                law.finest = tables.level[tables.level_start[law.table]]
            focus = vector_at(pull[n], 0) + carried + law_row[one, wp.static(rows.LAW.index("equilibrium"))] * law.axis
            pulled = wp.vec3(0.0)
            for m in range(
                int(pull[n, wp.static(rows.PULL.index("first"))]), int(pull[n, wp.static(rows.PULL.index("end"))])
            ):
                place = vector_at(sphere[m], 0) + sphere[m, wp.static(rows.SPHERE.index("share"))] * ahead
                displacement = place - focus
                d2 = wp.dot(displacement, displacement)
                if d2 < law.reach2:
                    pulled += force_at(traps, law, displacement)
                elif wp.isnan(d2):
                    pulled += wp.vec3(d2)  # what is no number must be seen in the sum
            total += pull[n, wp.static(rows.PULL.index("power"))] * pulled
        for k in range(3):
            hand[wp.static(rows.HAND.index("force_x")) + k] = total[k]

    return local_force


def machine_code(models: tuple[str, ...]) -> dict[str, Any]:
    """The kernel in float64, compiled for this CPU: the fields of `otwarp.haptics.force.compiled.CompiledLaw`.

    Warp keeps it in its cache; where it is not there yet, one or two models take about a second.

    Raises:
        RuntimeError: There is no compiler, or no room for what it makes.
    """
    kernel = kernel_module("optics.local_force", "float64").local_force_kernel(models)
    return {"models": models, **cpu_code(kernel)}
