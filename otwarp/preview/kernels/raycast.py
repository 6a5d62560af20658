"""The kernel: one thread per pixel, several samples each, layers composited front to back."""

# Warp takes a bare literal for a constant; wp.float32(0.0) declares a variable.

import warp as wp

from otwarp.preview.kernels.shading import Spot, Studio, fraction, surface
from otwarp.preview.kernels.tracing import World, glow, nearest

LAYERS = wp.constant(16)
"""Most translucent surfaces seen behind one another."""

# No adjoint, and the compiler's own inlining limits: Warp's default ones lengthen the compilation for little speed.
wp.set_module_options({"enable_backward": False, "fast_math": True, "cpu_compiler_flags": "-march=native"})


@wp.func
def background(studio: Studio, x: float, y: float) -> wp.vec3:
    """Linear colour of the background at (x, y), both from −1 to 1 across the picture: a soft pool of light above the
    middle."""
    r = wp.sqrt(0.55 * x * x + 0.8 * (y - 0.15) * (y - 0.15))
    return wp.lerp(studio.middle, studio.edge, wp.smoothstep(0.0, 1.15, r))


@wp.struct
class Ray:
    """A camera ray: origin, unit direction, and how much longer it is than its part along the view."""

    origin: wp.vec3
    direction: wp.vec3
    stretch: float


@wp.func
def camera_ray(studio: Studio, x: float, y: float) -> Ray:
    """Ray through (x, y), both from −1 to 1 across the picture."""
    a = 0.5 * studio.window[0] * x + studio.shift[0]
    b = 0.5 * studio.window[1] * y + studio.shift[1]
    ray = Ray()
    ray.origin = studio.position
    ray.direction = studio.forward
    ray.stretch = 1.0
    aside = a * studio.right + b * studio.up
    if studio.orthographic == 1:
        ray.origin = studio.position + aside
    else:
        slanted = studio.forward + aside
        ray.stretch = wp.length(slanted)
        ray.direction = slanted / ray.stretch
    return ray


@wp.func
def radiance(world: World, studio: Studio, px: float, py: float, sample: int, turn: wp.vec2) -> wp.vec3:
    """Linear colour seen at pixel coordinates (px, py) counted from the upper left corner."""
    x = 2.0 * px / float(studio.width) - 1.0
    y = 1.0 - 2.0 * py / float(studio.height)
    pixel = studio.window[0] / float(studio.width)
    ray = camera_ray(studio, x, y)
    origin = ray.origin
    direction = ray.direction
    low = studio.near * ray.stretch
    high = studio.far * ray.stretch
    colour = wp.vec3(0.0, 0.0, 0.0)
    clear = wp.float32(1.0)
    layer = wp.int32(0)
    while layer < LAYERS and clear > 0.01:
        hit = nearest(world, origin, direction, low, high)
        layer += 1
        if hit.index < 0:
            layer += LAYERS
        else:
            footprint = pixel
            if studio.orthographic == 0:
                footprint = pixel * hit.t
            spot = Spot()
            spot.point = origin + hit.t * direction
            spot.normal = hit.normal
            spot.direction = direction
            spot.footprint = footprint
            spot.sample = sample
            spot.turn = turn
            solid = world.solids[hit.index]
            seen = surface(world, studio, solid, spot)
            colour = colour + (clear * seen[3]) * wp.vec3(seen[0], seen[1], seen[2])
            clear = clear * (1.0 - seen[3])
            low = hit.t * 1.00002 + 1.0e-5 * footprint
            if solid.opacity >= 0.98 and clear < 0.5:
                high = hit.t
    colour = colour + clear * background(studio, x, y)
    light = glow(world, origin, direction, high)
    return (1.0 - light[3]) * colour + wp.vec3(light[0], light[1], light[2])


@wp.kernel
def draw_pixels(
    world: World,
    studio: Studio,
    pixels: wp.array(dtype=int),
    start: int,
    first: int,
    last: int,
    total: wp.array(dtype=wp.vec3),
):
    """Add samples `first` … `last` − 1 of the pixels listed from `start` on to `total` (linear colour)."""
    index = pixels[start + wp.tid()]
    column = index % studio.width
    row = index // studio.width
    # Interleaved gradient noise (J. Jimenez, SIGGRAPH 2014): neighbouring pixels use well-spread patterns.
    noise = fraction(52.9829189 * fraction(0.06711056 * float(column) + 0.00583715 * float(row)))
    turn = wp.vec2(noise, fraction(noise * 7.13 + 0.37))
    gathered = wp.vec3(0.0, 0.0, 0.0)
    for sample in range(first, last):
        dx = (float(sample % studio.grid) + 0.5) / float(studio.grid)
        # Diagonal by diagonal: the first `grid` samples already stand for the whole pixel.
        dy = (float((sample // studio.grid + sample) % studio.grid) + 0.5) / float(studio.grid)
        gathered = gathered + radiance(world, studio, float(column) + dx, float(row) + dy, sample, turn)
    total[index] = total[index] + gathered
