"""The scene on the device, the nearest surface along a ray, and how much light passes along one."""

# Warp takes a bare literal for a constant; wp.float32(0.0) declares a variable.

import warp as wp

from otwarp.preview.kernels.intersect import (
    MISS,
    enter_box,
    enter_capsule,
    enter_mesh,
    enter_plane,
    enter_sphere,
    enter_tube,
)

WAIST = wp.constant(0.075)
"""Radius of a drawn beam at its focus as a share of that at its wide end."""

KIND_SPHERE = wp.constant(0)
KIND_BOX = wp.constant(1)
KIND_TUBE = wp.constant(2)
KIND_CAPSULE = wp.constant(3)
KIND_PLANE = wp.constant(4)


@wp.struct
class TracedSolid:
    """A canonical solid: local = linear · world + shift, its look, for a mesh the index of its first corner normal."""

    linear: wp.mat33
    shift: wp.vec3
    kind: int
    size: wp.vec2
    colour: wp.vec3
    opacity: float
    roughness: float
    mesh: wp.uint64
    first: int


@wp.struct
class World:
    """Solids: infinite planes first, then those in the bounding volume hierarchy; beams in their own."""

    solids: wp.array(dtype=TracedSolid)
    endless: int
    bvh: wp.uint64
    count: int
    beams: wp.array(dtype=TracedSolid)
    beam_bvh: wp.uint64
    beam_count: int
    corner: wp.array(dtype=wp.vec3)


@wp.struct
class Hit:
    """Ray parameter (`MISS` if none), outward unit normal, and index of the solid."""

    t: float
    normal: wp.vec3
    index: int


@wp.func
def enter(
    solid: TracedSolid, corner: wp.array(dtype=wp.vec3), origin: wp.vec3, direction: wp.vec3, low: float
) -> wp.vec4:
    """Where a ray enters `solid` beyond `low` [µm]: (world normal, any length; parameter [µm], `MISS` if not)."""
    o = solid.linear * origin + solid.shift
    d = solid.linear * direction
    closest = -wp.dot(o, d) / wp.dot(d, d)
    o = o + closest * d
    low = low - closest
    hit = wp.vec4(0.0, 0.0, 0.0, MISS)
    if solid.kind == KIND_SPHERE:
        hit = enter_sphere(o, d, low, solid.size)
    elif solid.kind == KIND_BOX:
        hit = enter_box(o, d, low, solid.size)
    elif solid.kind == KIND_TUBE:
        hit = enter_tube(o, d, low, solid.size)
    elif solid.kind == KIND_CAPSULE:
        hit = enter_capsule(o, d, low, solid.size)
    elif solid.kind == KIND_PLANE:
        hit = enter_plane(o, d, low, solid.size)
    else:
        hit = enter_mesh(o, d, low, solid.mesh, corner, solid.first)
    if hit[3] >= MISS:
        return hit
    # Normals transform with the inverse transposed of the placement, that is with the transposed of `linear`.
    n = wp.transpose(solid.linear) * wp.vec3(hit[0], hit[1], hit[2])
    return wp.vec4(n[0], n[1], n[2], hit[3] + closest)


@wp.func
def take(world: World, index: int, origin: wp.vec3, direction: wp.vec3, low: float, best: Hit) -> Hit:
    """The nearer of `best` and the hit on solid `index` beyond ray parameter `low` [µm]."""
    hit = enter(world.solids[index], world.corner, origin, direction, low)
    if hit[3] < best.t:
        best.t = hit[3]
        best.normal = wp.normalize(wp.vec3(hit[0], hit[1], hit[2]))
        best.index = index
    return best


@wp.func
def nearest(world: World, origin: wp.vec3, direction: wp.vec3, low: float, high: float) -> Hit:
    """First surface between ray parameters `low` and `high` [µm]; index −1 if there is none."""
    result = Hit()
    result.t = high
    result.index = -1
    for k in range(world.endless):
        result = take(world, k, origin, direction, low, result)
    if world.count > 0:
        query = wp.bvh_query_ray(world.bvh, origin, direction)
        item = wp.int32(0)
        while wp.bvh_query_next(query, item, result.t):
            result = take(world, world.endless + item, origin, direction, low, result)
    return result


@wp.func
def passing(world: World, origin: wp.vec3, direction: wp.vec3, far: float, strength: float) -> float:
    """Share of light [0, 1] that passes from `origin` over the distance `far` [µm]; infinite planes cast no shadow.

    A translucent solid stops `strength` times its opacity.
    """
    if world.count == 0:
        return 1.0
    light = wp.float32(1.0)
    query = wp.bvh_query_ray(world.bvh, origin, direction)
    item = wp.int32(0)
    while wp.bvh_query_next(query, item, far):
        solid = world.solids[world.endless + item]
        hit = enter(solid, world.corner, origin, direction, 0.0)
        if hit[3] < far:
            opaque = solid.opacity
            if opaque < 0.98:
                opaque = opaque * strength
            light = light * (1.0 - opaque)
            if light < 0.02:
                return 0.0
    return light


@wp.func
def glow(world: World, origin: wp.vec3, direction: wp.vec3, high: float) -> wp.vec4:
    """Light gathered in beams up to ray parameter `high` [µm]: (linear colour times coverage, coverage in [0, 1]).

    Across a beam the intensity is a Gaussian of the local radius w, I = exp(−q ρ²/w²)/w², so that it peaks at the
    focus. Its integral along a straight ray is taken in closed form at the point closest to the axis (w is frozen
    there), which leaves no steps to see.
    """
    if world.beam_count == 0:
        return wp.vec4(0.0, 0.0, 0.0, 0.0)
    colour = wp.vec3(0.0, 0.0, 0.0)
    clear = wp.float32(1.0)
    query = wp.bvh_query_ray(world.beam_bvh, origin, direction)
    item = wp.int32(0)
    while wp.bvh_query_next(query, item, high):
        beam = world.beams[item]
        o = beam.linear * origin + beam.shift
        d = beam.linear * direction
        across = wp.max(d[0] * d[0] + d[1] * d[1], 0.05 * d[2] * d[2])
        t = -(o[0] * d[0] + o[1] * d[1]) / across
        x = o + t * d
        w = wp.float32(1.0)
        fade = wp.float32(1.0)
        if beam.kind == KIND_TUBE:
            # A Gaussian beam narrows to a waist along a hyperbola, not to a point.
            slope = 0.5 * (1.0 + beam.size[0]) + 0.5 * (beam.size[0] - 1.0) * x[2]
            w = wp.sqrt(slope * slope + WAIST * WAIST)
            fade = wp.smoothstep(-1.0, -0.55, x[2]) * wp.where(x[2] < 1.0, 1.0, 0.0)
        else:
            t = -wp.dot(o, d) / wp.dot(d, d)
            x = o + t * d
            across = wp.dot(d, d)
        q = 3.5
        away = q * (x[0] * x[0] + x[1] * x[1] + wp.where(beam.kind == KIND_TUBE, 0.0, x[2] * x[2])) / (w * w)
        # What an opaque surface behind the axis or in front of it leaves of the Gaussian.
        left = 1.0 / (1.0 + wp.exp(-3.0 * (high - t) * wp.sqrt(across) / w))
        amount = 0.75 * beam.opacity * fade * left * wp.exp(-away) / w
        if t > 0.0 and amount > 1.0e-4:
            cover = 1.0 - wp.exp(-amount)
            core = wp.min(0.8, 0.16 * amount)
            tint = (1.0 - core) * beam.colour + wp.vec3(core, core, core)
            colour = colour + (1.45 * clear * cover) * tint
            clear = clear * (1.0 - cover)
    return wp.vec4(colour[0], colour[1], colour[2], 1.0 - clear)
