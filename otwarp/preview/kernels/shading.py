"""Colour of a surface point: diffuse light with soft shadows, ambient light with occlusion, highlight and rim."""

# Warp takes a bare literal for a constant; wp.float32(0.0) declares a variable.

import warp as wp

from otwarp.preview.kernels.tracing import KIND_PLANE, TracedSolid, World, passing


@wp.struct
class Light:
    """A light: unit vector towards it, or its position; whether it is distant, casts shadows; colour × irradiance."""

    vector: wp.vec3
    distant: int
    shadows: int
    irradiance: wp.vec3


@wp.struct
class Studio:
    """Everything that is the same for all pixels: camera, light, background, and quality."""

    position: wp.vec3
    right: wp.vec3
    up: wp.vec3
    forward: wp.vec3
    orthographic: int
    window: wp.vec2
    shift: wp.vec2
    near: float
    far: float
    width: int
    height: int
    grid: int
    """Samples per pixel along each side."""
    occlusion_rays: int
    occlusion_reach: float
    lights: wp.array(dtype=Light)
    light_count: int
    softness: float
    """Tangent of the half angle of a distant light as it casts soft shadows."""
    sky: wp.vec3
    ground: wp.vec3
    zenith: wp.vec3
    """Up direction of the stage."""
    centre: wp.vec3
    fade: float
    """Distance from `centre` at which an infinite plane has faded into the background [µm]."""
    spacing: float
    """Distance between grid lines on planes [µm], 0 for no grid."""
    middle: wp.vec3
    edge: wp.vec3
    """Background colour at the middle and at the edge of the picture."""


@wp.func
def fraction(x: float) -> float:
    """x modulo 1, in [0, 1)."""
    return x - wp.floor(x)


@wp.func
def perpendicular(n: wp.vec3) -> wp.vec3:
    """A unit vector at right angles to the unit vector n."""
    if wp.abs(n[2]) < 0.9:
        return wp.normalize(wp.vec3(n[1], -n[0], 0.0))
    return wp.normalize(wp.vec3(0.0, n[2], -n[1]))


@wp.func
def environment(studio: Studio, direction: wp.vec3) -> wp.vec3:
    """Linear colour that a mirror in the unit vector `direction` would show: ground, sky, and a softbox overhead."""
    height = wp.dot(direction, studio.zenith)
    base = wp.lerp(studio.ground, studio.sky, wp.smoothstep(-0.35, 0.6, height))
    box = wp.smoothstep(0.55, 0.95, wp.dot(direction, wp.normalize(studio.zenith - 0.5 * studio.right)))
    return base + (1.3 * box) * studio.sky


@wp.func
def line_cover(x: float, spacing: float, half_width: float, footprint: float) -> float:
    """Share [0, 1] of a pixel `footprint` wide that lines `spacing` apart cover around x; all lengths in µm."""
    away = wp.abs(fraction(x / spacing + 0.5) - 0.5) * spacing
    cover = wp.clamp((half_width + 0.5 * footprint - away) / footprint, 0.0, 1.0)
    # Lines closer than a few pixels fade into their mean instead of shimmering.
    return cover * (1.0 - wp.smoothstep(0.12 * spacing, 0.4 * spacing, footprint))


@wp.func
def ruled(local: wp.vec3, spacing: float, half_width: float, footprint: float) -> float:
    """Share [0, 1] that square grid lines cover at the point `local` of a plane; lengths as in `line_cover`."""
    x = line_cover(local[0], spacing, half_width, footprint)
    return wp.max(x, line_cover(local[1], spacing, half_width, footprint))


@wp.struct
class Spot:
    """A surface point: where, its outward unit normal, the unit vector of the ray, the width of a pixel there [µm],
    the index of the sample within its pixel, and two numbers in [0, 1) that shift the pixel's sampling pattern."""

    point: wp.vec3
    normal: wp.vec3
    direction: wp.vec3
    footprint: float
    sample: int
    turn: wp.vec2


@wp.struct
class Lit:
    """Light that reaches a spot: diffuse irradiance, highlight, and the open share of its surroundings."""

    diffuse: wp.vec3
    shine: wp.vec3
    open_share: float


@wp.func
def plane_colour(studio: Studio, solid: TracedSolid, spot: Spot, facing: float) -> wp.vec3:
    """Linear colour of a plane with its grid: light lines on a dark plane, dark lines on a light one.

    `facing` is the cosine between normal and view, by which a pixel's footprint on the plane grows.
    """
    local = solid.linear * spot.point + solid.shift
    blur = spot.footprint / wp.max(facing, 0.05)
    lines = ruled(local, studio.spacing, 0.0045 * studio.spacing, blur)
    heavy = ruled(local, 5.0 * studio.spacing, 0.009 * studio.spacing, blur)
    ink = wp.vec3(0.45, 0.62, 0.75)
    if wp.dot(solid.colour, wp.vec3(0.33, 0.34, 0.33)) > 0.3:
        ink = wp.vec3(0.02, 0.03, 0.05)
    return wp.lerp(solid.colour, ink, 0.15 * wp.max(lines, 1.6 * heavy))


@wp.func
def scattered(axis: wp.vec3, u: float, v: float, spread: float) -> wp.vec3:
    """Unit vector near `axis` within a cone of tangent `spread`, from two numbers in [0, 1)."""
    side = perpendicular(axis)
    r = spread * wp.sqrt(u)
    return wp.normalize(axis + (r * wp.cos(6.2831853 * v)) * side + (r * wp.sin(6.2831853 * v)) * wp.cross(axis, side))


@wp.func
def pattern(spot: Spot, index: int) -> wp.vec2:
    """Point `index` of the R2 sequence (M. Roberts, 2018), which spreads evenly however many points are used."""
    u = fraction(float(index) * 0.7548777 + spot.turn[0])
    return wp.vec2(u, fraction(float(index) * 0.5698403 + spot.turn[1]))


@wp.func
def openness(world: World, studio: Studio, spot: Spot, start: wp.vec3) -> float:
    """Share [0, 1] of the surroundings that sees the spot: cosine-weighted rays over the occlusion reach."""
    total = wp.float32(0.0)
    side = perpendicular(spot.normal)
    other = wp.cross(spot.normal, side)
    for k in range(studio.occlusion_rays):
        uv = pattern(spot, spot.sample * studio.occlusion_rays + k)
        r = wp.sqrt(uv[0])
        angle = 6.2831853 * uv[1]
        ray = (r * wp.cos(angle)) * side + (r * wp.sin(angle)) * other + wp.sqrt(1.0 - uv[0]) * spot.normal
        total = total + passing(world, start, ray, studio.occlusion_reach, 0.6)
    if studio.occlusion_rays == 0:
        return 1.0
    return total / float(studio.occlusion_rays)


@wp.func
def lighting(world: World, studio: Studio, solid: TracedSolid, spot: Spot, wrap: float) -> Lit:
    """Light on a spot; `wrap` is how far (cosine) light creeps around the edge of the lit side."""
    result = Lit()
    start = spot.point + (0.3 * spot.footprint + 1.0e-5 * wp.length(spot.point)) * spot.normal
    sharp = wp.min(2.0 / wp.pow(wp.max(solid.roughness, 0.05), 4.0), 900.0)
    uv = pattern(spot, spot.sample)
    for k in range(studio.light_count):
        light = studio.lights[k]
        towards = light.vector
        reach = 1.0e9
        if light.distant == 0:
            towards = light.vector - spot.point
            reach = wp.length(towards)
            towards = towards / reach
        cosine = wp.dot(spot.normal, towards)
        if cosine > -wrap:
            seen = wp.float32(1.0)
            if light.shadows == 1:
                seen = passing(world, start, scattered(towards, uv[0], uv[1], studio.softness), reach, 0.6)
            result.diffuse = result.diffuse + (seen * (cosine + wrap) / (1.0 + wrap)) * light.irradiance
            if solid.kind != KIND_PLANE and cosine > 0.0:
                half = wp.max(wp.dot(spot.normal, wp.normalize(towards - spot.direction)), 0.0)
                peak = wp.pow(half, sharp) * (0.05 + 0.05 * wp.sqrt(sharp))
                result.shine = result.shine + (seen * peak) * light.irradiance
    result.open_share = openness(world, studio, spot, start)
    return result


@wp.func
def surface(world: World, studio: Studio, solid: TracedSolid, spot: Spot) -> wp.vec4:
    """(linear colour, opacity in [0, 1]) of a spot on `solid`: diffuse, highlight, mirror image and rim."""
    normal = spot.normal
    facing = wp.max(-wp.dot(normal, spot.direction), 0.0)
    translucent = solid.opacity < 0.98
    # Light wraps around translucent solids: they scatter inside.
    light = lighting(world, studio, solid, spot, wp.where(translucent, 0.45, 0.0))
    hemisphere = wp.lerp(studio.ground, studio.sky, 0.5 + 0.5 * wp.dot(normal, studio.zenith))
    arriving = light.diffuse + light.open_share * hemisphere
    opacity = solid.opacity
    if solid.kind == KIND_PLANE:
        albedo = solid.colour
        if studio.spacing > 0.0:
            albedo = plane_colour(studio, solid, spot, facing)
        if solid.size[0] > 1.0e29:
            far = wp.length(spot.point - studio.centre) / studio.fade
            opacity = opacity * wp.exp(-2.5 * far * far)
        colour = wp.cw_mul(albedo, arriving)
        return wp.vec4(colour[0], colour[1], colour[2], opacity)
    # Schlick's approximation of the Fresnel term (C. Schlick, Comput. Graph. Forum 13, 233, 1994,
    # doi:10.1111/1467-8659.1330233), weakened at grazing incidence as rough surfaces do.
    fresnel = (0.04 + 0.6 * wp.pow(1.0 - facing, 4.0)) * (1.0 - 0.8 * solid.roughness)
    tint = wp.lerp(wp.vec3(1.0, 1.0, 1.0), solid.colour, wp.where(translucent, 0.55, 0.2))
    mirror = environment(studio, spot.direction + (2.0 * facing) * normal)
    colour = wp.cw_mul(solid.colour, arriving) + light.shine + (fresnel * light.open_share) * wp.cw_mul(tint, mirror)
    if translucent:
        # A clear body is thin in the middle and deep at its rim, and its highlight hides what is behind.
        rim = wp.pow(1.0 - facing, 2.2)
        opacity = opacity + (1.0 - opacity) * wp.min(0.75 * rim + 0.8 * wp.length(light.shine), 0.95)
        colour = colour + (0.35 * rim) * wp.cw_mul(solid.colour, studio.sky)
    return wp.vec4(colour[0], colour[1], colour[2], opacity)
