"""Contact forces on lone spheres at the start of a step: of one other, and of the obstacles."""

import warp as wp

from otwarp.kernels.contact.contact import NO_CONTACT, pair_law
from otwarp.kernels.contact.curvature import relative_radius_term
from otwarp.kernels.contact.obstacles import distance_term, moving_pose, still_pose
from otwarp.kernels.core.faults import OVERLAP_LIMIT, Fault, raise_fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.packed import distance_of, point_of, radius_of
from otwarp.kernels.core.periodic import nearest
from otwarp.kernels.core.types import ModelData, ReadoutData
from otwarp.kernels.drivers.grid.data import GridData


@wp.struct
class SoftForce:
    """Net contact force on a sphere [pN], and the sum of the normal forces."""

    force: wp.vec3
    load: float


def soft_pair_term(f: Features) -> wp.Function:
    """`(model, readout, grid, world, a, here, j, step) -> SoftForce` of the sphere in slot j on body a."""

    @wp.func
    def soft_pair(
        model: ModelData,
        readout: ReadoutData,
        grid: GridData,
        world: int,
        a: int,
        here: wp.vec4,
        j: int,
        step: wp.int64,
    ) -> SoftForce:
        """Force and load [pN] on body a, whose centre and radius [µm] are `here`."""
        out = SoftForce(wp.vec3(0.0), 0.0)
        there = grid.place[grid.row[0], j]
        way = wp.vec3(here[0] - there[0], here[1] - there[1], here[2] - there[2])
        if wp.static(f.periodic):
            way = nearest(model.period, way)
        both = radius_of(here) + radius_of(there)
        far = both + grid.near.reach
        square = wp.length_sq(way)
        if square < far * far:
            overlap = both - wp.sqrt(square)
            least = wp.min(radius_of(here), radius_of(there))
            if overlap > OVERLAP_LIMIT * least:
                raise_fault(readout, world, a, wp.static(int(Fault.OVERLAP)), step)
            b = grid.order[grid.turn[0], j]
            law = pair_law(model.contact, a, b, radius_of(here) * radius_of(there) / both, overlap)
            out.force = law.force * wp.normalize(way)
            out.load = wp.abs(law.force)
        return out

    return soft_pair


def soft_walls_term(f: Features) -> wp.Function:
    """`(model, readout, grid, world, a, here, step) -> SoftForce` of the obstacles."""
    pose_at = moving_pose if f.moving_obstacles else still_pose
    distance_to = distance_term(f.obstacles)
    relative_radius = relative_radius_term(f.obstacles)

    @wp.func
    def soft_walls(
        model: ModelData, readout: ReadoutData, grid: GridData, world: int, a: int, here: wp.vec4, step: wp.int64
    ) -> SoftForce:
        """Sum of force and load [pN] over the obstacles within reach."""
        out = SoftForce(wp.vec3(0.0), 0.0)
        time = wp.float64(step) * model.time_step
        far = radius_of(here) + grid.near.reach
        for o in range(model.obstacles.shape.shape[0]):
            wall = pose_at(model.obstacles, o, time)
            away = point_of(here) - wall.position
            if wp.static(f.periodic):
                away = nearest(model.period, away)
            if wp.length(away) < far + model.obstacles.bound[o]:
                local = wp.quat_rotate_inv(wall.rotation, away)
                hit = distance_to(model.obstacles, o, local, far)
                if distance_of(hit) < far:
                    overlap = radius_of(here) - distance_of(hit)
                    if overlap > OVERLAP_LIMIT * radius_of(here):
                        raise_fault(readout, world, a, wp.static(int(Fault.OVERLAP)), step)
                    outward = point_of(hit)
                    relative = relative_radius(model.obstacles, o, local, outward, radius_of(here))
                    law = pair_law(model.contact, a, NO_CONTACT, relative, overlap)
                    out.force += law.force * wp.quat_rotate(wall.rotation, outward)
                    out.load += wp.abs(law.force)
        return out

    return soft_walls
