"""A sphere near a plane, exactly: resistances to translation and rotation, and the pull of a shear flow (float64).

Motions along the wall follow O'Neill's method. With z the distance from the wall and all fields in the first azimuthal
mode, Stokes flow is v = ½ r p + (harmonic), so

    p = Q cos φ,  v_ρ = ½(ρQ + U₂ + U₀) cos φ,  v_φ = ½(U₂ − U₀) sin φ,  v_z = ½(zQ + 2W) cos φ,

where Q, W, U₀ and U₂ are harmonic of azimuthal order 1, 1, 0 and 2. In bispherical coordinates (ξ, η), wall at ξ = 0
and sphere at ξ = α = arcosh(h/a), with μ = cos η and w = cosh ξ − μ:

    Q = √w sin η Σ q_n(ξ) P'_n(μ), W alike, U₀ = √w Σ a_n(ξ) P_n(μ), U₂ = √w sin²η Σ b_n(ξ) P''_n(μ),

each coefficient a combination of cosh and sinh of (n + ½)ξ, kept here by its values on the two surfaces. No slip on
both surfaces, and ∇·v = 0 on both: ∇·v is harmonic, so it then vanishes everywhere. By the recurrences of Legendre
polynomials each condition couples neighbouring n only; the banded system is solved as it stands.

Sources: M. E. O'Neill, Mathematika 11, 67 (1964), doi:10.1112/S0025579300003508; W. R. Dean, M. E. O'Neill, Mathematika
10, 13 (1963), doi:10.1112/S0025579300003314; A. J. Goldman, R. G. Cox, H. Brenner, Chem. Eng. Sci. 22, 637 and 653
(1967), doi:10.1016/0009-2509(67)80047-2 and doi:10.1016/0009-2509(67)80048-4; H. Brenner, Chem. Eng. Sci. 16, 242
(1961), doi:10.1016/0009-2509(61)80035-3; G. B. Jeffery, Proc. London Math. Soc. s2-14, 327 (1915),
doi:10.1112/plms/s2_14.1.327.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from otwarp.errors import InputError

DIGITS = 40.0
"""Terms are kept until they fall below e⁻⁴⁰ of the first: beyond rounding."""

LARGEST = 350.0
"""Argument of sinh and cosh above which their quotients are at their limits."""

NODES = 600
"""Nodes of the quadrature of the torque; its error is below 1e-9 for gaps of 1e-4 radii and more."""


@dataclass(frozen=True, kw_only=True)
class WallResistance:
    """Resistances of a sphere above a no-slip plane, as multiples of those of the free sphere.

    Translation is in units of 6πηa, rotation of 8πηa³, and their coupling of 6πηa²: the force on a sphere that rotates
    with Ω about an axis t along the wall is +6πηa² `coupling` Ω (t × n), and the torque on one that moves with U is
    −6πηa² `coupling` (U × n), n the normal out of the wall.

    Attributes:
        normal: Translation along n.
        parallel: Translation along the wall without rotation.
        spin: Rotation about n.
        roll: Rotation about an axis along the wall, without translation.
        coupling: Between the two motions along the wall.
        shear_force: Force on a fixed sphere in shear u = γ̇z along the wall, in units of 6πηa·γ̇h.
        shear_torque: Torque on it about its centre, in units of 4πηa³γ̇, its free value.
    """

    normal: float
    parallel: float
    spin: float
    roll: float
    coupling: float
    shear_force: float
    shear_torque: float

    @property
    def sliding(self) -> float:
        """Translation along the wall of a sphere that is free to rotate [1]; its inverse is the mobility μ∥/μ₀."""
        return self.parallel - 0.75 * self.coupling**2 / self.roll


def wall_resistance(gap: float) -> WallResistance:
    """Exact resistances at `gap` = h/a − 1, the distance of the surfaces over the radius.

    Relative error below 1e-8 for gaps from 1e-4 on; what tends to zero far away keeps its digits only to 1e-9
    absolutely.

    Raises:
        InputError: A gap outside [1e-5, 1e4], where the series are too long or the differences too small.
    """
    if not 1e-5 <= gap <= 1e4:
        raise InputError(f"argument gap: {gap:g} sphere radii; allowed: [1e-05, 10000]")
    # arcosh(1 + g) without loss for small gaps
    alpha = float(np.log1p(gap + np.sqrt(gap * (gap + 2.0))))
    forces, torques = _along_the_wall(alpha)
    height = 1.0 + gap
    return WallResistance(
        normal=_brenner(alpha),
        parallel=float(forces[0]),
        spin=_jeffery(alpha),
        roll=-0.75 * float(torques[1]),
        coupling=-float(forces[1]),
        shear_force=float(forces[2]) / height,
        shear_torque=1.5 * float(torques[2]),
    )


def _brenner(alpha: float) -> float:
    """Resistance to motion along the normal over 6πηa, Brenner's series."""
    n = np.arange(1, int(DIGITS / alpha) + 30, dtype=float)
    k = n + 0.5
    x = np.minimum(k * alpha, LARGEST)
    s = np.sinh(alpha)
    top = 2.0 * np.sinh(2.0 * x) + (2.0 * n + 1.0) * np.sinh(2.0 * alpha)
    bottom = 4.0 * np.sinh(x) ** 2 - ((2.0 * n + 1.0) * s) ** 2
    # top/bottom − 1 with 2 sinh 2x − 4 sinh² x = 2(1 − e⁻²ˣ), which keeps the digits
    excess = (top - 2.0 * np.sinh(2.0 * x) + 2.0 * (1.0 - np.exp(-2.0 * x)) + ((2.0 * n + 1.0) * s) ** 2) / bottom
    return float(4.0 / 3.0 * s * np.sum(n * (n + 1.0) / ((2.0 * n - 1.0) * (2.0 * n + 3.0)) * excess))


def _jeffery(alpha: float) -> float:
    """Resistance to rotation about the normal over 8πηa³: sinh³α Σ 1/sinh³ nα."""
    n = np.arange(1, int(DIGITS / alpha) + 30, dtype=float)
    return float(np.sum((np.sinh(alpha) / np.sinh(np.minimum(n * alpha, LARGEST))) ** 3))


def _band(
    source: np.ndarray, target: np.ndarray, up: Callable, down: Callable, stay: Callable | None = None
) -> sparse.csr_matrix:
    """Matrix that takes the coefficient of degree n to degrees n + 1, n − 1 and n, within the degrees of `target`."""
    columns = np.arange(len(source))
    rows, cols, values = [], [], []
    for shift, factor in ((1, up), (-1, down), (0, stay)):
        if factor is None:
            continue
        row = source + shift - target[0]
        inside = (row >= 0) & (row < len(target))
        rows.append(row[inside])
        cols.append(columns[inside])
        values.append(np.broadcast_to(factor(source.astype(float)), source.shape)[inside])
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(cols)))
    return sparse.csr_matrix(entries, shape=(len(target), len(source)))


class _Legendre:
    """Recurrences of P_n (n ≥ 0), P'_n (n ≥ 1) and P''_n (n ≥ 2) up to degree `top`, as banded matrices."""

    def __init__(self, top: int):
        self.n0, self.n1, self.n2 = np.arange(top + 1), np.arange(1, top + 1), np.arange(2, top + 1)
        n0, n1, n2 = self.n0, self.n1, self.n2

        def none(n: np.ndarray) -> np.ndarray:
            return 0.0 * n

        # multiplication by μ in each basis
        self.mu0 = _band(n0, n0, lambda n: (n + 1) / (2 * n + 1), lambda n: n / (2 * n + 1))
        self.mu1 = _band(n1, n1, lambda n: n / (2 * n + 1), lambda n: (n + 1) / (2 * n + 1))
        self.mu2 = _band(n2, n2, lambda n: (n - 1) / (2 * n + 1), lambda n: (n + 2) / (2 * n + 1))
        # (1 − μ²)P'_n in P, P'_n in P'', P_n in P', d/dμ of P_n in P', (n − 1)(n + 2) times P'_n for n ≥ 2
        self.lowered = _band(n1, n0, lambda n: -n * (n + 1) / (2 * n + 1), lambda n: n * (n + 1) / (2 * n + 1))
        self.raised = _band(n1, n2, lambda n: 1 / (2 * n + 1), lambda n: -1 / (2 * n + 1))
        self.raised0 = _band(n0, n1, lambda n: 1 / (2 * n + 1), lambda n: -1 / (2 * n + 1))
        self.slope0 = _band(n0, n1, none, none, np.ones_like)
        self.slope2 = _band(n2, n1, none, none, lambda n: (n - 1) * (n + 2))
        # (1 − μ²)P''_n = 2μP'_n − n(n + 1)P_n in P'
        self.curved = 2.0 * self.mu1 - self.raised0[:, 1:] @ sparse.diags(n1 * (n1 + 1.0))


def _slopes(degrees: np.ndarray, alpha: float) -> tuple[np.ndarray, np.ndarray]:
    """(n + ½) coth and (n + ½)/sinh of (n + ½)α: ∂f/∂ξ on one surface by the values of f on it and on the other."""
    k = degrees + 0.5
    x = np.minimum(k * alpha, LARGEST)
    return k / np.tanh(x), k / np.sinh(x)


def _continuity(basis: _Legendre, alpha: float, sphere: bool) -> list[sparse.spmatrix]:
    """Rows of ∇·v = 0 on the sphere or on the wall, divided by √w⁻¹ sin η w, for the unknowns of `_along_the_wall`.

    (5/2)q − (3/2)μCq − μSq_ξ + (1 − μ²)Cq_μ − ½Ca − Sa_ξ + (1 − μC)a_μ + (3/2)C(1 − μ²)b − S(1 − μ²)b_ξ
    − (1 − μC) Σ(n − 1)(n + 2)b_nP'_n + 2(1 − μC)ω_ξ + S(−3μω + 2(1 − μ²)ω_μ) = 0, with C = cosh ξ and S = sinh ξ.
    """
    c, s = (np.cosh(alpha), np.sinh(alpha)) if sphere else (1.0, 0.0)
    one = sparse.identity(len(basis.n1))
    bent = one - c * basis.mu1
    values = (
        2.5 * one - 1.5 * c * basis.mu1 + c * basis.curved,
        -0.5 * c * basis.raised0 + bent @ basis.slope0,
        1.5 * c * basis.curved[:, 1:] - bent @ basis.slope2,
    )
    slopes = (-s * basis.mu1, -s * basis.raised0, -s * basis.curved[:, 1:])
    row: list[sparse.spmatrix] = []
    for value, slope, degrees in zip(values, slopes, (basis.n1, basis.n0, basis.n2), strict=True):
        near, far = (sparse.diags(d) for d in _slopes(degrees, alpha))
        row += [value + slope @ near, -slope @ far] if sphere else [slope @ far, value - slope @ near]
    near, far = _slopes(basis.n1, alpha)
    vertical = 2.0 * bent @ sparse.diags(near if sphere else far)
    if sphere:
        vertical = vertical + s * (-3.0 * basis.mu1 + 2.0 * basis.curved)
    return [*row, vertical]


def _along_the_wall(alpha: float) -> tuple[np.ndarray, np.ndarray]:
    """Force along x over 6πηa·(a) and torque about y over 6πηa²·(a) that drive three motions along the wall.

    The fluid on the sphere moves with x̂, with ŷ × (r − centre)/a, and with z x̂/a. Signs: what the liquid takes from the
    sphere, so a resistance is positive; for the torque of the second and third motion see `_torques`.
    """
    basis = _Legendre(int(DIGITS / alpha) + 30)
    c, s = np.cosh(alpha), np.sinh(alpha)
    n0, n1 = basis.n0, basis.n1
    sphere0, sphere1 = c * sparse.identity(len(n0)) - basis.mu0, c * sparse.identity(len(n1)) - basis.mu1
    wall0 = sparse.identity(len(n0)) - basis.mu0
    sphere2, wall2 = (v * sparse.identity(len(basis.n2)) - basis.mu2 for v in (c, 1.0))
    # unknowns: q, a and b on sphere and wall, ω on the sphere (on the wall it vanishes)
    matrix = sparse.bmat(
        [
            [0.5 * basis.lowered, None, sphere0, None, None, None, None],
            [None, 0.5 * basis.lowered, None, wall0, None, None, None],
            [0.5 * basis.raised, None, None, None, sphere2, None, None],
            [None, 0.5 * basis.raised, None, None, None, wall2, None],
            [0.5 * s * sparse.identity(len(n1)), None, None, None, None, None, sphere1],
            _continuity(basis, alpha, True),
            _continuity(basis, alpha, False),
        ],
        format="csc",
    )
    # expansions of 1, z and ρ on the sphere, from 1/√w = √2 Σ e^{−(n+½)ξ} P_n and its derivatives
    root = np.sqrt(2.0)
    one = 2.0 * root * np.exp(-(n0 + 0.5) * alpha)
    height = 2.0 * (n0 + 0.5) * one
    radius = 2.0 * root * np.exp(-(n1 + 0.5) * alpha)
    motions = ((one, 0.0 * radius), (s * height - c * one, -s * radius), (s * height, 0.0 * radius))
    sides = []
    for across, vertical in motions:
        side = np.zeros(3 * len(n1) + 2 * len(n0) + 2 * len(basis.n2))
        side[: len(n0)] = sphere0 @ across
        start = 2 * len(n0) + 2 * len(basis.n2)
        side[start : start + len(n1)] = sphere1 @ vertical
        sides.append(side)
    solution = spsolve(matrix, np.array(sides).T)
    parts = [
        np.split(x, np.cumsum([len(n1), len(n1), len(n0), len(n0), len(basis.n2), len(basis.n2)]))
        for x in np.asarray(solution).T
    ]
    forces = np.array([_force(basis, alpha, p) for p in parts])
    return forces, _torques(basis, alpha, parts)


def _force(basis: _Legendre, alpha: float, parts: list[np.ndarray]) -> float:
    """Force over 6πηa, from the shear stress on the wall, which takes all of it: (√2 sinh α/6) Σ[n(n + 1)C_n + E_n].

    C_n and E_n are the coefficients of sinh (n + ½)ξ in q_n and a_n: ∂/∂ξ at the wall over (n + ½).
    """
    total = 0.0
    for degrees, sphere, wall, factor in (
        (basis.n1, parts[0], parts[1], basis.n1 * (basis.n1 + 1.0)),
        (basis.n0, parts[2], parts[3], np.ones(len(basis.n0))),
    ):
        near, far = _slopes(degrees, alpha)
        total += float(np.sum(factor * (far * sphere - near * wall) / (degrees + 0.5)))
    return np.sqrt(2.0) / 6.0 * np.sinh(alpha) * total


def _torques(basis: _Legendre, alpha: float, parts: list[list[np.ndarray]]) -> np.ndarray:
    """Torque about y through the centre over 6πηa², for the three motions; +: on the sphere (third: in the shear flow).

    On a surface without slip the traction is −p n + ∂v'/∂n, with v' the flow seen from the surface, so that
    T_y = πa ∫ [cos χ ∂_n(½ρQ + U₀)' − sin χ ∂_n(½zQ + W)'] ρ ds over the meridian, χ the polar angle on the sphere.
    """
    c, s = np.cosh(alpha), np.sinh(alpha)
    # η = α sinh t resolves the outer region, where η is of the order of α, and the gap alike
    t, weight = np.polynomial.legendre.leggauss(NODES)
    span = np.arcsinh(np.pi / alpha)
    t, weight = 0.5 * span * (t + 1.0), 0.5 * span * weight
    eta, weight = alpha * np.sinh(t), weight * alpha * np.cosh(t)
    mu, sine = np.cos(eta), np.sin(eta)
    w = (c - 1.0) + 2.0 * np.sin(0.5 * eta) ** 2
    p0, p1 = _polynomials(mu, len(basis.n0))
    rho, z = sine / w, s / w
    rho_xi, z_xi = -sine * s / w**2, (1.0 - mu * c) / w**2
    radius, centre = 1.0 / s, c / s
    torques = []
    for m, (qs, qw, as_, aw, _, _, ws) in enumerate(parts):
        (near0, far0), (near1, far1) = _slopes(basis.n0, alpha), _slopes(basis.n1, alpha)
        q, q_xi = qs @ p1, (near1 * qs - far1 * qw) @ p1
        a, a_xi = as_ @ p0, (near0 * as_ - far0 * aw) @ p0
        o, o_xi = ws @ p1, (near1 * ws) @ p1
        root = np.sqrt(w)
        big_q, q_slope = root * sine * q, sine * (0.5 * s / root * q + root * q_xi)
        across = 0.5 * rho_xi * big_q + 0.5 * rho * q_slope + 0.5 * s / root * a + root * a_xi
        vertical = 0.5 * z_xi * big_q + 0.5 * z * q_slope + sine * (0.5 * s / root * o + root * o_xi)
        # less the flow that moves with the surface: (z − h)/a·x̂ − x/a·ẑ, or z/a·x̂
        across = across - (0.0, 2.0, 2.0)[m] * s * z_xi
        vertical = vertical + (0.0, 1.0, 0.0)[m] * s * rho_xi
        integrand = (z - centre) / radius * across - rho / radius * vertical
        # ∂_n = −w ∂_ξ and ds = dη/w
        torques.append(-np.pi * radius * float(np.sum(weight * integrand * rho)) / (6.0 * np.pi * radius**2))
    return np.array(torques) * (1.0, 1.0, -1.0)


def _polynomials(mu: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """P_n for n = 0 … count − 1 and P'_n for n = 1 … count − 1 at `mu`, (count, m) and (count − 1, m)."""
    p, slope = np.zeros((count, len(mu))), np.zeros((count, len(mu)))
    p[0], p[1], slope[1] = 1.0, mu, 1.0
    for n in range(1, count - 1):
        p[n + 1] = ((2 * n + 1) * mu * p[n] - n * p[n - 1]) / (n + 1)
        slope[n + 1] = slope[n - 1] + (2 * n + 1) * p[n]
    return p, slope[1:]
