"""Kernels that call the functions of the ray caster: one module for the tests of all its files."""

import warp as wp

from otwarp.preview.kernels import intersect, shading
from otwarp.preview.kernels.shading import Spot, Studio
from otwarp.preview.kernels.tracing import TracedSolid, World, enter, glow, nearest, passing

wp.set_module_options({"enable_backward": False, "cpu_compiler_flags": "-march=native"})


@wp.kernel
def enter_canonical(
    kind: int, size: wp.vec2, origin: wp.array(dtype=wp.vec3), direction: wp.array(dtype=wp.vec3), low: float,
    hit: wp.array(dtype=wp.vec4),
):  # fmt: skip
    """A canonical solid by its own function, with the origin where it wants it: closest to the middle."""
    n = wp.tid()
    d = direction[n]
    closest = -wp.dot(origin[n], d) / wp.dot(d, d)
    o, least = origin[n] + closest * d, low - closest
    found = wp.vec4(0.0, 0.0, 0.0, intersect.MISS)
    if kind == 0:
        found = intersect.enter_sphere(o, d, least, size)
    elif kind == 1:
        found = intersect.enter_box(o, d, least, size)
    elif kind == 2:
        found = intersect.enter_tube(o, d, least, size)
    elif kind == 3:
        found = intersect.enter_capsule(o, d, least, size)
    elif kind == 4:
        found = intersect.enter_plane(o, d, least, size)
    hit[n] = wp.vec4(found[0], found[1], found[2], wp.where(found[3] < intersect.MISS, found[3] + closest, found[3]))


@wp.kernel
def enter_triangles(
    mesh: wp.uint64, corner: wp.array(dtype=wp.vec3), first: int, origin: wp.array(dtype=wp.vec3),
    direction: wp.array(dtype=wp.vec3), low: float, hit: wp.array(dtype=wp.vec4),
):  # fmt: skip
    """A mesh."""
    n = wp.tid()
    hit[n] = intersect.enter_mesh(origin[n], direction[n], low, mesh, corner, first)


@wp.kernel
def enter_placed(
    world: World, index: int, origin: wp.array(dtype=wp.vec3), direction: wp.array(dtype=wp.vec3), low: float,
    hit: wp.array(dtype=wp.vec4),
):  # fmt: skip
    """A solid where it stands in the world."""
    n = wp.tid()
    hit[n] = enter(world.solids[index], world.corner, origin[n], direction[n], low)


@wp.kernel
def trace(
    world: World, origin: wp.array(dtype=wp.vec3), direction: wp.array(dtype=wp.vec3), low: float, high: float,
    strength: float, hit: wp.array(dtype=wp.vec4), index: wp.array(dtype=int), light: wp.array(dtype=float),
    gathered: wp.array(dtype=wp.vec4),
):  # fmt: skip
    """First surface, what passes and what beams give, along each ray."""
    n = wp.tid()
    found = nearest(world, origin[n], direction[n], low, high)
    hit[n] = wp.vec4(found.normal[0], found.normal[1], found.normal[2], found.t)
    index[n] = found.index
    light[n] = passing(world, origin[n], direction[n], high, strength)
    gathered[n] = glow(world, origin[n], direction[n], high)


@wp.kernel
def numbers(
    studio: Studio, u: wp.array(dtype=wp.vec3), x: wp.array(dtype=wp.vec4), side: wp.array(dtype=wp.vec3),
    mirror: wp.array(dtype=wp.vec3), near: wp.array(dtype=wp.vec3), other: wp.array(dtype=wp.vec4),
):  # fmt: skip
    """Arithmetic of shading: of a unit vector u, and of four numbers x."""
    n = wp.tid()
    side[n] = shading.perpendicular(u[n])
    mirror[n] = shading.environment(studio, u[n])
    near[n] = shading.scattered(u[n], x[n][0], x[n][1], 0.3)
    spot = Spot()
    spot.turn = wp.vec2(x[n][0], x[n][1])
    point = shading.pattern(spot, n)
    lines = shading.line_cover(x[n][2], 1.0, 0.02, 0.03)
    other[n] = wp.vec4(shading.fraction(x[n][2]), lines, point[0], point[1])


@wp.kernel
def shade(
    world: World, studio: Studio, solid: TracedSolid, point: wp.array(dtype=wp.vec3), normal: wp.array(dtype=wp.vec3),
    direction: wp.array(dtype=wp.vec3), turn: wp.array(dtype=wp.vec2), diffuse: wp.array(dtype=wp.vec3),
    shine: wp.array(dtype=wp.vec3), open_share: wp.array(dtype=float), colour: wp.array(dtype=wp.vec4),
):  # fmt: skip
    """Light on a spot of `solid`, and its colour."""
    n = wp.tid()
    spot = Spot()
    spot.point = point[n]
    spot.normal = normal[n]
    spot.direction = direction[n]
    spot.footprint = 0.01
    spot.sample = 0
    spot.turn = turn[n]
    lit = shading.lighting(world, studio, solid, spot, wp.where(solid.opacity < 0.98, 0.45, 0.0))
    diffuse[n] = lit.diffuse
    shine[n] = lit.shine
    open_share[n] = lit.open_share
    colour[n] = shading.surface(world, studio, solid, spot)
