"""The exactly solvable model of a trap with scattering force: F_ρ = −k_r ρ, F_z = −k_z z − ε ρ²/w².

Mangeat, Guérin & Dean 2021, doi:10.48550/arXiv.2110.04362 (there F_z has ε (1 − ρ²/w²); here z is measured from the
equilibrium on the axis, which is ε/k_z higher). x and y are Ornstein–Uhlenbeck processes and z is driven by their
squares, so the moments close and the characteristic function of z solves a Riccati equation. The force is no gradient:
the steady state is not Boltzmann's and carries a toroidal current, seen as the part of ⟨δρ²(0) δz(t)⟩ that is odd in t.
The field goes into the simulation as a force table of bicubic splines, which hold quadratics without error.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from otwarp.optics import Beam, ForceTable, Particle
from otwarp.optics.analysis import TrapProperties
from otwarp.optics.table import TableLevel, steepest_slope
from otwarp.scene import Body, Scene, Settings, Sphere, Track, Trap
from otwarp.simulation.simulation import Simulation
from tests.reference.fokker_planck import cylinder
from tests.simulation.setups import ENERGY, drag
from tests.validation import scheme
from tests.validation.laws import Law, across_worlds, lagged

RADIUS = 0.5
K_R, K_Z = 1.0, 0.5
BEND = 6.0
"""ε/w² [pN/µm²]: so strong that ⟨z⟩ moves by its thermal width, and var z grows by a fifth."""

REACH, SPACING = 2.5, 0.02
STEP = 0.01
"""κ_r·dt."""
BIAS = 4.0 * abs(scheme.variance(scheme.DEFAULT, STEP) - 1.0) + 2e-3
"""Relative error of cumulants up to order 3: that of a variance at this step for each of at most four factors, and
float32."""

GAMMA = drag(RADIUS)
WIDTH2 = ENERGY / K_R
"""⟨x²⟩ [µm²]."""


def field(rho: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(F_ρ, F_z) [pN]."""
    return -K_R * rho, -K_Z * z - BEND * rho**2


def spline_table() -> ForceTable:
    """The field at 1 mW as one grid of cubic B-spline coefficients: f − (h²/6) ∇²f for a quadratic f."""
    beam = Beam()
    rho = SPACING * (np.arange(round(REACH / SPACING) + 4) - 1)
    z = SPACING * (np.arange(round(2 * REACH / SPACING) + 4) - 1) - REACH
    r, height = np.meshgrid(rho, z)
    across, along = field(r, height)
    # ∂²/∂ρ² alone: the grid is Cartesian in (ρ, z)
    along = along + SPACING**2 / 3.0 * BEND
    node = np.stack([across, 0.0 * r, along], axis=-1)[:, :, None, :] / beam.force_scale
    known = {
        "beam": beam,
        "sphere": Particle(radius=RADIUS, index=1.45),
        "tolerance": 1e-3,
        "interpolation": "bicubic",
        "peak": 10.0 / beam.force_scale,
        "error": 0.0,
        "levels": (TableLevel(REACH, SPACING, node.astype(np.float32)),),
        "properties": TrapProperties(
            equilibrium=0.0,
            others=(),
            stiffness=(K_R, K_R, K_Z),
            escape_force=(1.0,) * 4,
            escape_distance=(0.8 * REACH,) * 4,
            depth=1.0,
        ),
    }
    return ForceTable(steepest=steepest_slope(ForceTable(steepest=1.0, **known)), **known)


def test_the_table_holds_the_field():
    """Within float32 of its coefficients, wherever the sphere goes."""
    table = spline_table()
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.9, 0.9, (200, 3))
    force = table.force(points) * table.beam.force_scale
    rho = np.hypot(points[:, 0], points[:, 1])
    across, along = field(rho, points[:, 2])
    np.testing.assert_allclose((force[:, :2] * points[:, :2]).sum(axis=1) / rho, across, atol=1e-5)
    np.testing.assert_allclose(force[:, 2], along, atol=1e-5)


def cumulants() -> dict[str, float]:
    """Joint cumulants of s = ρ² and z, in this order one from the other, from the generator applied to s^m z^n.

    s has the mean and cumulants of an exponential distribution of mean 2k_B T/k_r, and its noise is 8 k_B T s/γ.
    """
    mean = 2.0 * WIDTH2
    sz = -BEND * mean**2 / (2.0 * K_R + K_Z)
    ssz = (-BEND * 2.0 * mean**3 + 8.0 * ENERGY * sz) / (4.0 * K_R + K_Z)
    szz = -2.0 * BEND * ssz / (2.0 * K_R + 2.0 * K_Z)
    return {
        "⟨z⟩": -BEND * mean / K_Z,
        "⟨ρ²⟩": mean,
        "cov(ρ², z)": sz,
        "var z": ENERGY / K_Z - BEND * sz / K_Z,
        "⟨δz³⟩": -BEND * szz / K_Z,
    }


def characteristic(q: float) -> complex:
    """⟨e^(iqz)⟩ = e^(−q²k_B T/2k_z) (1 + 2A(0)⟨x²⟩)⁻¹ e^(−2B(0)) with A' = 4DA² + 2κA − iq(ε/γw²)e^(−κ_z u), B' = −2DA.

    A and B vanish at u = ∞; u is the time before now, over which ρ² has pushed z (Feynman & Kac).
    """
    kappa, kappa_z, d = K_R / GAMMA, K_Z / GAMMA, ENERGY / GAMMA

    def backward(v: float, y: np.ndarray) -> list[complex]:
        drive = 1j * q * BEND / GAMMA * np.exp(-kappa_z * (end - v))
        return [-(4.0 * d * y[0] ** 2 + 2.0 * kappa * y[0] - drive), 2.0 * d * y[0]]

    end = 40.0 / kappa_z
    a, b = solve_ivp(backward, (0.0, end), np.zeros(2, dtype=complex), rtol=1e-10, atol=1e-12).y[:, -1]
    return np.exp(-0.5 * q * q * ENERGY / K_Z - 2.0 * b) / (1.0 + 2.0 * a * WIDTH2)


def odd_part(time: float) -> float:
    """⟨δρ²(0) δz(t)⟩ − ⟨δz(0) δρ²(t)⟩."""
    fast, slow = 2.0 * K_R / GAMMA, K_Z / GAMMA
    sz, ss = cumulants()["cov(ρ², z)"], (2.0 * WIDTH2) ** 2
    driven = BEND / GAMMA * ss * (np.exp(-slow * time) - np.exp(-fast * time)) / (fast - slow)
    return float(sz * np.exp(-slow * time) - driven - sz * np.exp(-fast * time))


def test_characteristic_function_has_the_moments():
    """Derivatives of log⟨e^(iqz)⟩ at 0 against the cumulants: two derivations of the same model."""
    h, exact = 0.05, cumulants()
    log = {n: np.log(characteristic(n * h)) for n in (-2, -1, 1, 2)}
    mean = ((log[1] - log[-1]) * 2.0 / 3.0 - (log[2] - log[-2]) / 12.0).imag / h
    variance = -((log[1] + log[-1]) * 4.0 / 3.0 - (log[2] + log[-2]) / 12.0).real / h**2
    assert mean == pytest.approx(exact["⟨z⟩"], rel=1e-5)
    assert variance == pytest.approx(exact["var z"], rel=1e-5)
    third = (log[2] - log[-2] - 2.0 * (log[1] - log[-1])).imag / (2.0 * h**3)
    assert third == pytest.approx(-exact["⟨δz³⟩"], rel=1e-2)


def test_the_finite_volumes_solve_the_model():
    """The solver that the test of real tables trusts, against the exact moments and the odd part of the correlation."""
    exact = cumulants()
    rho, z = np.linspace(0.0, 0.4, 101), np.linspace(-1.5, 0.45, 241)
    swarm = cylinder(field, rho, z, diffusion=ENERGY / GAMMA, energy=ENERGY)
    m, s, height = swarm.stationary(), swarm.first**2, swarm.second
    ds, dz = s - m @ s, height - m @ height
    got = {"⟨z⟩": m @ height, "⟨ρ²⟩": m @ s, "cov(ρ², z)": m @ (ds * dz), "var z": m @ dz**2, "⟨δz³⟩": m @ dz**3}
    for name, value in got.items():
        assert value == pytest.approx(exact[name], rel=1e-2), name
    time = 0.5 * GAMMA / K_R
    odd = m @ (ds * swarm.later_mean(dz, time)) - m @ (dz * swarm.later_mean(ds, time))
    assert odd == pytest.approx(odd_part(time), rel=1e-2)


def run(device: str, worlds: int, samples: int, monkeypatch: pytest.MonkeyPatch) -> tuple[np.ndarray, float]:
    """(samples, W, 3) positions every half relaxation time, and that time [s]."""
    table = spline_table()
    monkeypatch.setattr("otwarp.optics.table_build.build_table", lambda *a, **k: table)
    bead = Body(prim="/World/B", spheres=(Sphere(prim="/World/B/s", radius=RADIUS, refractive_index=1.45),))
    trap = Trap(
        prim="/World/T",
        position=Track.constant((0.0, 0.0, 0.0)),
        power=Track.constant(1.0),
        model="table",
        interpolation="bicubic",
    )
    scene = Scene(bodies=(bead,), traps=(trap,), settings=Settings(time_step=STEP * GAMMA / K_R))
    sim = Simulation(scene, worlds=worlds, seed=71, device=device)
    every = round(0.5 / STEP)
    sim.step(40 * every)
    out = np.empty((samples, worlds, 3), dtype=np.float32)
    for i in range(samples):
        sim.step(every)
        out[i] = sim.state.position.numpy()[:, 0]
    return out.astype(float), every * sim.time_step


def check_model(expect_law: Law, x: np.ndarray, interval: float) -> None:
    exact = cumulants()
    s, z = (x[..., :2] ** 2).sum(axis=-1), x[..., 2]
    ds, dz = s - exact["⟨ρ²⟩"], z - exact["⟨z⟩"]
    # about the exact means, so that worlds are independent; δz³ is then a moment about the exact mean
    found = {"⟨z⟩": z, "⟨ρ²⟩": s, "cov(ρ², z)": ds * dz, "var z": dz**2, "⟨δz³⟩": dz**3}
    for name, values in found.items():
        mean, error = across_worlds(values.mean(axis=0))
        expect_law(name, mean, exact[name], error, bias=BIAS * abs(exact[name]))
    for q in (3.0, 8.0, 16.0):
        value = characteristic(q)
        for name, values, part in (("cos", np.cos(q * z), value.real), ("sin", np.sin(q * z), value.imag)):
            mean, error = across_worlds(values.mean(axis=0))
            expect_law(f"⟨{name} qz⟩ at q = {q:g}/µm", mean, part, error, bias=BIAS * min(1.0, q * q * exact["var z"]))
    for lag in (1, 2, 4):
        one, other = lagged(ds[..., None], dz[..., None], lag), lagged(dz[..., None], ds[..., None], lag)
        mean, error = across_worlds((one - other)[:, 0, 0])
        odd = odd_part(lag * interval)
        assert abs(odd) > 10.0 * error, "the current must be seen"
        expect_law(f"odd part of ⟨δρ²(0) δz(t)⟩ at κt = {0.5 * lag:g} [µm³]", mean, odd, error, bias=BIAS * abs(odd))


def test_model(expect_law, device, monkeypatch):
    """Moments, characteristic function and current of the model.

    Source: Mangeat, Guérin & Dean 2021, doi:10.48550/arXiv.2110.04362.
    """
    check_model(expect_law, *run(device, 2000, 100, monkeypatch))


@pytest.mark.validate
def test_model_precisely(expect_law, device, monkeypatch):
    """Moments, characteristic function and current of the model.

    Source: Mangeat, Guérin & Dean 2021, doi:10.48550/arXiv.2110.04362.
    """
    check_model(expect_law, *run(device, 8000, 400, monkeypatch))
