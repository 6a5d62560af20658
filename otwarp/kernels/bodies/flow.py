"""Background flow: velocity and angular velocity with which a sphere that nothing holds goes along with the liquid.

Common signature `(flow, world, point, radius) -> Move` per second (µm/s, rad/s), world axes. By Faxén's laws the sphere
has the velocity u + a²/6 ∇²u at its centre, which is the mean of u over its surface, and turns with half the curl;
with the radius 0 these are of the undisturbed liquid. Terms of higher order vanish in all flows here but of data.

Source: H. Faxén 1922, doi:10.1002/andp.19223731003; S. Kim, S. J. Karrila, Microhydrodynamics, 1991, section 3.3.
"""

import warp as wp

from otwarp.kernels.core.types import FlowData, Move, world_row


@wp.func
def speed_of(flow: FlowData, world: int) -> float:
    """Speed U of the flow in a world [µm/s]."""
    return flow.speed[world_row(flow.speed.shape[0], world)]


@wp.func
def axis_along(flow: FlowData) -> wp.vec3:
    """x̂ of the flow's frame: turned axes are the same for all points, so that a loop over points turns them once."""
    return wp.quat_rotate(flow.rotation, wp.vec3(1.0, 0.0, 0.0))


@wp.func
def axis_aside(flow: FlowData) -> wp.vec3:
    """ŷ of the flow's frame, about which planar flows turn."""
    return wp.quat_rotate(flow.rotation, wp.vec3(0.0, 1.0, 0.0))


@wp.func
def axis_up(flow: FlowData) -> wp.vec3:
    """ẑ of the flow's frame, along which the velocity of planar flows changes."""
    return wp.quat_rotate(flow.rotation, wp.vec3(0.0, 0.0, 1.0))


@wp.func
def uniform_flow(flow: FlowData, world: int, point: wp.vec3, radius: float) -> Move:
    """u = U x̂ [µm/s] of the flow's frame, without rotation; the radius [µm] makes no difference."""
    speed = speed_of(flow, world)
    return Move(speed * axis_along(flow), wp.vec3(0.0))


@wp.func
def shear_flow(flow: FlowData, world: int, point: wp.vec3, radius: float) -> Move:
    """u = γ̇ z x̂ [µm/s], half curl ½γ̇ ŷ [rad/s], in the flow's frame; the radius [µm] makes no difference."""
    rate = flow.shear_rate[world_row(flow.shear_rate.shape[0], world)]
    z = wp.dot(axis_up(flow), point - flow.origin)
    return Move(rate * z * axis_along(flow), 0.5 * rate * axis_aside(flow))


@wp.func
def poiseuille_flow(flow: FlowData, world: int, point: wp.vec3, radius: float) -> Move:
    """Mean of u = U (1 − (z/h)²) x̂ [µm/s] over a sphere of `radius` [µm], half curl −U z/h² ŷ [rad/s].

    The plates are at z = ±h; outside them all is 0. ∇²u = −2U/h² x̂.
    """
    speed = speed_of(flow, world)
    relative = wp.dot(axis_up(flow), point - flow.origin) / flow.half_height
    linear = float(0.0)
    angular = float(0.0)
    if wp.abs(relative) < 1.0:
        wide = radius / flow.half_height
        linear = speed * (1.0 - relative * relative - wide * wide / 3.0)
        angular = -speed * relative / flow.half_height
    return Move(linear * axis_along(flow), angular * axis_aside(flow))


TERMS = wp.constant(64)
"""Most terms of the series of a rectangular channel: at its side walls they leave 2e-5 of the largest velocity."""

_HALF_PI = wp.constant(1.5707963267948966)


@wp.struct
class ChannelSums:
    """Σ s_n/n³·C_n cos, Σ s_n/n²·S_n cos and Σ s_n/n²·C_n sin of `rectangular_flow`, s_n = (−1)^((n−1)/2)."""

    value: wp.float32
    across: wp.float32
    up: wp.float32


@wp.func
def channel_sums(turn: float, near: float, far: float, length: float) -> ChannelSums:
    """Sums over odd n of cosh(nα)/cosh(nβ) = (e^(−n·near) + e^(−n·far))/(1 + e^(−n·length)) with cos, sin of n·turn.

    Terms are made from the last by products; they end where the exponential has fallen below rounding.
    """
    sums = ChannelSums()
    one = wp.exp(-near)
    other = wp.exp(-far)
    end = wp.exp(-length)
    c = wp.cos(turn)
    s = wp.sin(turn)
    c2 = c * c - s * s
    s2 = 2.0 * c * s
    one2, other2, end2 = one * one, other * other, end * end
    sign = float(1.0)
    n = float(1.0)
    for _k in range(int(TERMS)):
        weight = sign / (n * n * (1.0 + end))
        sums.value += weight * (one + other) * c / n
        sums.across += weight * (one - other) * c
        sums.up += weight * (one + other) * s
        if one < 1.0e-9:
            break
        one *= one2
        other *= other2
        end *= end2
        turned = c * c2 - s * s2
        s = s * c2 + c * s2
        c = turned
        sign = -sign
        n += 2.0
    return sums


@wp.func
def rectangular_flow(flow: FlowData, world: int, point: wp.vec3, radius: float) -> Move:
    """Mean of u [µm/s] over a sphere of `radius` [µm] in a channel of rectangular section, and half curl [rad/s].

    With h ≤ b the half sides and G = −∇p/η: u = G/2 (h² − z²) − 16Gh²/π³ Σ s_n/n³ cosh(nπy/2h)/cosh(nπb/2h) cos(nπz/2h)
    over odd n (White 2006, Viscous Fluid Flow, eq. 3-48; Bruus 2008, Theoretical Microfluidics, 3.4.6); ∇²u = −G x̂.
    """
    drive = flow.drive * speed_of(flow, world)
    local = wp.quat_rotate_inv(flow.rotation, point - flow.origin)
    h, b = flow.half_height, flow.half_width
    y, z = wp.abs(local[1]), local[2]
    linear = float(0.0)
    about_y = float(0.0)
    about_z = float(0.0)
    if y < b and wp.abs(z) < h:
        wave = _HALF_PI / h
        sums = channel_sums(wave * z, wave * (b - y), wave * (b + y), 2.0 * wave * b)
        # with the wave number κ = π/2h: 16h²/π³ = 4/(π κ²), 8h/π² = 4/(π κ)
        per_pi = 0.5 / _HALF_PI
        linear = drive * (0.5 * (h * h - z * z) - 4.0 * per_pi / (wave * wave) * sums.value - radius * radius / 6.0)
        about_y = 0.5 * drive * (4.0 * per_pi / wave * sums.up - z)
        about_z = 0.5 * drive * 4.0 * per_pi / wave * sums.across * wp.sign(local[1])
    return Move(
        wp.quat_rotate(flow.rotation, wp.vec3(linear, 0.0, 0.0)),
        wp.quat_rotate(flow.rotation, wp.vec3(0.0, about_y, about_z)),
    )


@wp.func
def grid_flow(flow: FlowData, world: int, point: wp.vec3, radius: float) -> Move:
    """Velocity u + a²/6 ∇²u [µm/s] and half curl [rad/s] of a field on a grid, trilinear between its nodes; 0 outside.

    Derivatives are those of second order on the nodes. The world makes no difference.
    """
    g = wp.cw_mul(wp.quat_rotate_inv(flow.rotation, point - flow.origin) - flow.low, flow.per_spacing)
    for axis in range(3):
        if flow.repeat[axis] > 0.0:
            g[axis] = g[axis] - wp.floor(g[axis] / flow.repeat[axis]) * flow.repeat[axis]
    linear = wp.vec3(0.0)
    angular = wp.vec3(0.0)
    if wp.min(g) >= 0.0 and wp.min(flow.last - g) >= 0.0:
        ny, nz = int(flow.last[1]) + 1, int(flow.last[2]) + 1
        i = wp.min(int(g[0]), int(flow.last[0]) - 1)
        j = wp.min(int(g[1]), ny - 2)
        k = wp.min(int(g[2]), nz - 2)
        part = g - wp.vec3(float(i), float(j), float(k))
        for corner in range(8):
            a, b, c = corner // 4, (corner // 2) % 2, corner % 2
            weight = wp.where(a == 1, part[0], 1.0 - part[0])
            weight *= wp.where(b == 1, part[1], 1.0 - part[1])
            weight *= wp.where(c == 1, part[2], 1.0 - part[2])
            n = ((i + a) * ny + j + b) * nz + k + c
            linear += weight * (flow.node[n, 0] + radius * radius * flow.node[n, 2])
            angular += weight * flow.node[n, 1]
    return Move(wp.quat_rotate(flow.rotation, linear), wp.quat_rotate(flow.rotation, angular))


FLOW_TERMS: dict[str, wp.Function] = {
    "uniform": uniform_flow,
    "shear": shear_flow,
    "poiseuille": poiseuille_flow,
    "rectangular": rectangular_flow,
    "grid": grid_flow,
}
"""Flow profiles by name."""
