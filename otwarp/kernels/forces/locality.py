"""Which bodies move otherwise elsewhere: where one stage is exact, and whom a second one looks at."""

from functools import reduce

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import ModelData
from otwarp.kernels.forces.table import active_forces


def needs_place(f: Features) -> bool:
    """Whether what moves some body of a step depends on where it is, or on how it is turned."""
    kinds = [rigid for rigid, there in ((False, f.spheres), (True, f.rigid)) if there]
    forces = any(row.is_local(rigid=rigid) for row in active_forces(f) for rigid in kinds)
    return forces or any(moves_with_place(f, rigid=rigid) for rigid in kinds)


def moves_with_place(f: Features, *, rigid: bool) -> bool:
    """Whether flow or mobility depend on the place of a lone sphere, or with `rigid` of a body that turns."""
    return f.walls > 0 or f.coupling or f.flow not in (None, "uniform") or (rigid and f.flow is not None)


def needs_place_term(f: Features) -> wp.Function:
    """`(model, b) -> bool`: `needs_place` of one body."""
    of_sphere, of_rigid = (_of_kind(f, rigid=rigid) for rigid in (False, True))

    @wp.func
    def needs(model: ModelData, b: int) -> bool:
        """Whether a force on body b, its mobility or the flow depends on where it is."""
        found = bool(False)
        if wp.static(not f.rigid):
            found = of_sphere(model, b)
        if wp.static(f.rigid):
            found = of_rigid(model, b) if model.body.rigid[b] != 0 else of_sphere(model, b)
        return found

    return needs


def _of_kind(f: Features, *, rigid: bool) -> wp.Function:
    """`(model, b) -> bool` for lone spheres, or for bodies that turn."""
    rows = [row for row in active_forces(f) if row.is_local(rigid=rigid)]

    @wp.func
    def always(model: ModelData, b: int) -> bool:
        """Something that moves every body depends on place."""
        return True

    @wp.func
    def never(model: ModelData, b: int) -> bool:
        """Nothing that moves a body of this kind depends on place."""
        return False

    def either(one: wp.Function, other: wp.Function) -> wp.Function:
        """Whether one of two forces acts on a body."""

        @wp.func
        def acts(model: ModelData, b: int) -> bool:
            """Whether one of the rows so far, or the next row, acts on body b."""
            return one(model, b) or other(model, b)

        return acts

    some = [row.acts(f) for row in rows if row.acts]
    if len(some) < len(rows) or moves_with_place(f, rigid=rigid):
        return always
    return reduce(either, some) if some else never
