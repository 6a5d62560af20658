"""Optical traps: where they are, and the force each exerts on a sphere.

A force term has the signature `(traps, world, trap, displacement, radius, kind) -> force per mW`, with `displacement`
the vector from the trap's equilibrium point to the sphere's centre and `kind` the sphere's optical kind. A new model is
one function and one line of `TRAP_TERMS`.
"""

import functools

import warp as wp

from otwarp.kernels.exact import exact_force_term
from otwarp.kernels.force_table import blend_weight, table_term
from otwarp.kernels.keyframes import find_key, key_weight
from otwarp.kernels.types import ControlData, TrapData, world_row


@wp.func
def piecewise_ratio(
    d2: float, stiffness: float, threshold: float, inverse_square: float, offset: float, cutoff: float
) -> float:
    """f(d)/d of the paper's piecewise law (eq. 1): K below the threshold, (A/d² + C)/d up to the cutoff, 0 beyond.

    `d2` is the squared distance [µm²]; the result is in pN/µm per mW.
    """
    ratio = stiffness
    if d2 >= threshold * threshold:
        ratio = (inverse_square / d2 + offset) / wp.sqrt(d2)
    if d2 >= cutoff * cutoff:
        ratio = 0.0
    return ratio


@wp.func
def harmonic_ratio(d2: float, stiffness: float, cutoff: float) -> float:
    """f(d)/d of a linear spring that ends at the cutoff [pN/µm per mW]."""
    return wp.where(d2 < cutoff * cutoff, stiffness, 0.0)


@wp.func
def law_scale(traps: TrapData, trap: int, radius: float) -> float:
    """Factor on distances for a sphere of `radius`: ray optics makes the force a function of d/r."""
    fitted = traps.law_radius[trap]
    scale = float(1.0)
    if fitted > 0.0:
        scale = fitted / radius
    return scale


@wp.func
def harmonic_isotropic(
    traps: TrapData, world: int, trap: int, displacement: wp.vec3, radius: float, kind: int
) -> wp.vec3:
    """F = −K·d per mW inside the cutoff, equal in all directions."""
    s = law_scale(traps, trap, radius)
    k = traps.stiffness[world_row(traps.stiffness.shape[0], world), trap]
    cutoff = traps.cutoff[world_row(traps.cutoff.shape[0], world), trap]
    return (-s * harmonic_ratio(s * s * wp.dot(displacement, displacement), k, cutoff)) * displacement


@wp.func
def harmonic_split(traps: TrapData, world: int, trap: int, displacement: wp.vec3, radius: float, kind: int) -> wp.vec3:
    """F = −K_r·ρ − K_z·z per mW, each inside its own cutoff."""
    s = law_scale(traps, trap, radius)
    axis = traps.axis[trap]
    z = wp.dot(displacement, axis)
    across = displacement - z * axis
    k = traps.stiffness[world_row(traps.stiffness.shape[0], world), trap]
    cutoff = traps.cutoff[world_row(traps.cutoff.shape[0], world), trap]
    kz = traps.axial_stiffness[world_row(traps.axial_stiffness.shape[0], world), trap]
    cutoff_z = traps.axial_cutoff[world_row(traps.axial_cutoff.shape[0], world), trap]
    reach = wp.max(cutoff, cutoff_z)
    force = wp.vec3(0.0)
    if s * s * wp.dot(displacement, displacement) < reach * reach:
        f_r = harmonic_ratio(s * s * wp.dot(across, across), k, cutoff)
        f_z = harmonic_ratio(s * s * z * z, kz, cutoff_z)
        force = (-s * f_r) * across - (s * f_z * z) * axis
    return force


@wp.func
def piecewise_isotropic(
    traps: TrapData, world: int, trap: int, displacement: wp.vec3, radius: float, kind: int
) -> wp.vec3:
    """The paper's eq. 1, directed to the trap and equal in all directions, per mW."""
    s = law_scale(traps, trap, radius)
    ratio = piecewise_ratio(
        s * s * wp.dot(displacement, displacement),
        traps.stiffness[world_row(traps.stiffness.shape[0], world), trap],
        traps.threshold[world_row(traps.threshold.shape[0], world), trap],
        traps.inverse_square[world_row(traps.inverse_square.shape[0], world), trap],
        traps.offset[world_row(traps.offset.shape[0], world), trap],
        traps.cutoff[world_row(traps.cutoff.shape[0], world), trap],
    )
    return (-s * ratio) * displacement


@wp.func
def piecewise_split(traps: TrapData, world: int, trap: int, displacement: wp.vec3, radius: float, kind: int) -> wp.vec3:
    """Eq. 1 with separate curves across and along the beam, per mW; zero beyond the larger cutoff."""
    s = law_scale(traps, trap, radius)
    axis = traps.axis[trap]
    z = wp.dot(displacement, axis)
    across = displacement - z * axis
    cutoff = traps.cutoff[world_row(traps.cutoff.shape[0], world), trap]
    cutoff_z = traps.axial_cutoff[world_row(traps.axial_cutoff.shape[0], world), trap]
    reach = wp.max(cutoff, cutoff_z)
    force = wp.vec3(0.0)
    if s * s * wp.dot(displacement, displacement) < reach * reach:
        f_r = piecewise_ratio(
            s * s * wp.dot(across, across),
            traps.stiffness[world_row(traps.stiffness.shape[0], world), trap],
            traps.threshold[world_row(traps.threshold.shape[0], world), trap],
            traps.inverse_square[world_row(traps.inverse_square.shape[0], world), trap],
            traps.offset[world_row(traps.offset.shape[0], world), trap],
            cutoff,
        )
        f_z = piecewise_ratio(
            s * s * z * z,
            traps.axial_stiffness[world_row(traps.axial_stiffness.shape[0], world), trap],
            traps.axial_threshold[world_row(traps.axial_threshold.shape[0], world), trap],
            traps.axial_inverse_square[world_row(traps.axial_inverse_square.shape[0], world), trap],
            traps.axial_offset[world_row(traps.axial_offset.shape[0], world), trap],
            cutoff_z,
        )
        force = (-s * f_r) * across - (s * f_z * z) * axis
    return force


def tabulated_term(interpolation: str, layers: int) -> wp.Function:
    """The table of the trap's beam and the sphere's kind, with z measured from the focus along the beam."""
    force_at = table_term(interpolation, layers)

    @wp.func
    def tabulated(traps: TrapData, world: int, trap: int, displacement: wp.vec3, radius: float, kind: int) -> wp.vec3:
        """Into the beam's frame, which is the world's up to a rotation, and back."""
        axis = traps.axis[trap]
        side = traps.side[trap]
        up = wp.cross(axis, side)
        z = wp.dot(displacement, axis) + traps.equilibrium[trap]
        x = wp.dot(displacement, side)
        y = wp.dot(displacement, up)
        f = force_at(traps.tables, traps.table[trap, kind], x, y, z)
        return f[0] * side + f[1] * up + f[2] * axis

    return tabulated


@functools.lru_cache(maxsize=16)
def exact_term(orders: int, nodes: int) -> wp.Function:
    """The exact force of the trap's beam on the sphere's kind, in float64; it ends as the tables do.

    Args:
        orders, nodes: Capacities of `exact_force_term`.
    """
    force_at = exact_force_term(orders, nodes)

    @wp.func
    def exact(traps: TrapData, world: int, trap: int, displacement: wp.vec3, radius: float, kind: int) -> wp.vec3:
        """Into the beam's frame and back; zero from the cutoff of the pair's table on."""
        axis = traps.axis[trap]
        side = traps.side[trap]
        up = wp.cross(axis, side)
        z = wp.dot(displacement, axis) + traps.equilibrium[trap]
        x = wp.dot(displacement, side)
        y = wp.dot(displacement, up)
        table = traps.table[trap, kind]
        cutoff = traps.tables.radius[traps.tables.level_start[table + 1] - 1]
        d2 = x * x + y * y + z * z
        force = wp.vec3(0.0)
        if d2 < cutoff * cutoff:
            q = force_at(traps.exact[table], wp.vec3d(wp.float64(x), wp.float64(y), wp.float64(z)))
            w = traps.exact_scale[table] * (1.0 - blend_weight(d2, cutoff))
            force = w * (wp.float32(q[0]) * side + wp.float32(q[1]) * up + wp.float32(q[2]) * axis)
        return force

    return exact


LAYER_NAMES = {1: "", 2: "_polarized", 3: "_vortex"}
"""What the key of a table's term says about its layers."""

TRAP_TERMS: dict[str, tuple[int, wp.Function]] = {
    "harmonic_isotropic": (0, harmonic_isotropic),
    "harmonic_split": (1, harmonic_split),
    "piecewise_isotropic": (2, piecewise_isotropic),
    "piecewise_split": (3, piecewise_split),
    **{
        f"table_{interpolation}{name}": (4 + 3 * cubic + layers - 1, tabulated_term(interpolation, layers))
        for cubic, interpolation in enumerate(("bilinear", "bicubic"))
        for layers, name in LAYER_NAMES.items()
    },
}
"""Force models by name: the key stored in `TrapData.model`, and the term."""

EXACT_KEY = 10
"""Key of the exact model, whose term depends on the room its sphere and reach need."""


def exact_name(orders: int, nodes: int) -> str:
    """Name of the exact model with these capacities."""
    return f"exact_{orders}_{nodes}"


def trap_term(name: str) -> tuple[int, wp.Function]:
    """Key and term of a model: of `TRAP_TERMS`, or of the exact one by `exact_name`."""
    if name.startswith("exact_"):
        orders, nodes = (int(part) for part in name.split("_")[1:])
        return EXACT_KEY, exact_term(orders, nodes)
    return TRAP_TERMS[name]


def trap_force_term(models: tuple[str, ...]) -> wp.Function:
    """One force function for the models a scene uses: the term itself, or a branch on the trap's model."""
    key, head = trap_term(models[0])
    if len(models) == 1:
        return head
    rest = trap_force_term(models[1:])

    @wp.func
    def either(traps: TrapData, world: int, trap: int, displacement: wp.vec3, radius: float, kind: int) -> wp.vec3:
        """This model, or one of the rest."""
        force = wp.vec3(0.0)
        if traps.model[trap] == wp.static(key):
            force = head(traps, world, trap, displacement, radius, kind)
        else:
            force = rest(traps, world, trap, displacement, radius, kind)
        return force

    return either


@wp.func
def commanded_still(traps: TrapData, control: ControlData, world: int, trap: int, time: wp.float64) -> wp.vec4:
    """Commanded focus [µm] and power [mW] of a trap that only the control moves."""
    p = control.trap_position[world_row(control.trap_position.shape[0], world), trap]
    return wp.vec4(p[0], p[1], p[2], control.trap_power[world_row(control.trap_power.shape[0], world), trap])


@wp.func
def commanded_animated(traps: TrapData, control: ControlData, world: int, trap: int, time: wp.float64) -> wp.vec4:
    """Commanded focus [µm] and power [mW] of a trap, from the scene's key frames where `follow` says so."""
    command = commanded_still(traps, control, world, trap, time)
    follow = control.follow[trap]
    first = traps.key_start[trap]
    last = traps.key_start[trap + 1] - 1
    if follow != 0 and last > first:
        key = find_key(traps.key_time, first, last, time)
        w = key_weight(traps.key_time, key, time)
        value = (1.0 - w) * traps.key_value[key] + w * traps.key_value[key + 1]
        if (follow & 1) != 0:
            command = wp.vec4(value[0], value[1], value[2], command[3])
        if (follow & 2) != 0:
            command = wp.vec4(command[0], command[1], command[2], value[3])
    return command


@wp.func
def limited_focus(traps: TrapData, world: int, trap: int, now: wp.vec3, wanted: wp.vec3, dt: float) -> wp.vec3:
    """Focus after one step towards `wanted`, no faster than the trap's speed limit."""
    limit = traps.speed_limit[world_row(traps.speed_limit.shape[0], world), trap] * dt
    way = wanted - now
    distance = wp.length(way)
    result = wanted
    if distance > limit:
        result = now + (limit / distance) * way
    return result
