"""The fit recovers known constants, the committed laws are continuous, and they are what the fit prints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.laws import TrapLaw
from otwarp.units import FORCE_PER_POWER
from scenes.author import fit_trap_laws, trap_laws

LAWS = (trap_laws.RADIAL, trap_laws.AXIAL, trap_laws.ISOTROPIC)


def test_fit_recovers_known_constants_from_noisy_samples():
    d = np.linspace(0.0, 4.0, 81)
    noise = 0.002 * np.random.default_rng(5).normal(size=d.shape)
    fit = fit_trap_laws.fit_law(d, 0.6 * fit_trap_laws.shape(d, 1.9, 3.1) + noise)
    assert fit.stiffness == pytest.approx(0.6, abs=5 * fit.errors[0])
    assert fit.threshold == pytest.approx(1.9, abs=5 * fit.errors[1])
    assert fit.cutoff == pytest.approx(3.1, abs=5 * fit.errors[2])
    assert max(fit.errors) < 0.01
    assert fit.r_squared > 0.999
    assert fit.rmse == pytest.approx(0.002, rel=0.3)


def test_fit_reports_a_misfit_honestly():
    d = np.linspace(0.0, 4.0, 81)
    fit = fit_trap_laws.fit_law(d, np.sin(3 * d))
    assert fit.r_squared < 0.5


@pytest.mark.parametrize("law", LAWS)
def test_committed_laws_are_continuous(law: TrapLaw):
    assert law.inverse_square / law.threshold**2 + law.offset == pytest.approx(law.stiffness * law.threshold, abs=1e-8)
    assert law.inverse_square / law.cutoff**2 + law.offset == pytest.approx(0.0, abs=1e-8)
    assert (law.power, law.radius) == (1.0, 2.5)


def _write(folder: Path, name: str, axis: int, at: np.ndarray, force: np.ndarray, height: float) -> None:
    rows = np.zeros((len(at), 6))
    rows[:, 2] = height
    rows[:, axis] = at
    rows[:, 3 + axis] = force / (FORCE_PER_POWER * fit_trap_laws.MEDIUM_INDEX)
    file = folder / f"{fit_trap_laws.CASE}_{name}.csv"
    np.savetxt(file, rows, delimiter=",", header="x_um,y_um,z_um,Qx,Qy,Qz", comments="")


def test_folder_is_read_with_the_right_signs_units_and_equilibrium(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    x = np.linspace(-4.0, 4.0, 81)
    radial = -np.sign(x) * 0.5 * fit_trap_laws.shape(np.abs(x), 2.0, 3.0)
    _write(tmp_path, "radial_x", 0, x, radial, 0.4)
    _write(tmp_path, "radial_y", 1, x, radial, 0.4)
    z = x - 0.4
    axial = -np.sign(z) * np.where(z > 0, 0.25, 0.4) * fit_trap_laws.shape(np.abs(z), 1.5, 2.5)
    _write(tmp_path, "axial", 2, x, axial, 0.0)
    equilibrium, fits = fit_trap_laws.fit_folder(tmp_path)
    assert equilibrium == 0.4
    for name, expected in (("RADIAL", (0.5, 2.0, 3.0)), ("AXIAL", (0.25, 1.5, 2.5))):
        fit = fits[name]
        assert (fit.stiffness, fit.threshold, fit.cutoff) == pytest.approx(expected, rel=1e-3)
    fit_trap_laws.main([str(tmp_path)])
    out = capsys.readouterr().out
    assert "EQUILIBRIUM = 0.4000" in out
    assert "RADIAL = continuous_law(0.5000, 2.0" in out


def test_missing_file_is_named(tmp_path: Path):
    with pytest.raises(InputError, match=r"radial_x\.csv: no such file"):
        fit_trap_laws.fit_folder(tmp_path)


def test_similarity_scales_stiffness_and_equilibrium():
    twice = 2 * trap_laws.FITTED_RADIUS
    assert trap_laws.equilibrium_of(twice) == pytest.approx(2 * trap_laws.EQUILIBRIUM)
    assert trap_laws.stiffness_of(trap_laws.RADIAL, twice, 3.0) == pytest.approx(1.5 * trap_laws.RADIAL.stiffness)
    assert trap_laws.peak_force_of(trap_laws.AXIAL, 2.0) == pytest.approx(
        2 * trap_laws.AXIAL.stiffness * trap_laws.AXIAL.threshold
    )
