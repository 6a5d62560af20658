"""Calibrations recover what targets were made with, within the standard errors that they state; nonsense is refused.

Seeds are fixed; a result fails at five standard errors.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.vision import Microscope, Rendering, Sensor
from otwarp.vision.calibration import (
    Bench,
    Calibration,
    Measured,
    depth_scale,
    load_calibration,
    pixel_of_grid,
    pixel_of_steps,
    trap_plane,
)
from otwarp.vision.calibration.planes import expected_depth_scale
from otwarp.vision.calibration.synthetic import calibrate
from otwarp.vision.fourier import Fourier

SIGMAS = 5.0
SCENE = str(Path(__file__).parents[3] / "scenes" / "strategy_b.usda")


def bench(**changes: Any) -> Bench:
    given: dict[str, Any] = {"numerical_aperture": 0.8, "condenser_aperture": 0.3, "pixel": 0.12} | changes
    return Bench(microscope=Microscope(**given), sensor=Sensor(noise=0.02), rendering=Rendering(rings=1, margin=2.0),
                 width=80, seed=5)  # type: ignore[arg-type]  # fmt: skip


def agrees(found: Measured, truth: float | None = None) -> bool:
    expected = found.authored if truth is None else truth
    assert expected is not None and found.low < found.value < found.high
    return abs(found.value - expected) < SIGMAS * found.standard_error


@pytest.fixture(scope="module")
def fourier() -> Fourier:
    return Fourier("cpu")


@pytest.mark.quick
def test_a_grid_tells_the_pixel(fourier: Fourier) -> None:
    page = bench().grid(2.2, -7.0, fourier)
    pixel, angle = pixel_of_grid(page, 2.2, authored=0.12)
    assert agrees(pixel) and agrees(angle, -7.0) and pixel.standard_error < 2e-4 * 2
    # what is not said right is not found out: the scale is the pitch's
    wrong, _ = pixel_of_grid(page, 2.42)
    assert wrong.value == pytest.approx(1.1 * pixel.value)


def test_known_steps_tell_the_pixel(fourier: Fourier) -> None:
    here = bench()
    stage = np.array([(x, y) for x in (-1.5, 0.0, 1.5) for y in (-1.2, 0.1, 1.4)])
    turn = np.exp(1j * np.radians(20.0)) * (stage @ np.array([1.0, 1j]))
    images = here.steps(here.bead(fourier), np.stack([turn.real, turn.imag], axis=1))
    pixel, angle = pixel_of_steps(images, stage, authored=0.12)
    assert agrees(pixel) and agrees(angle, 20.0) and pixel.standard_error < 5e-4


def test_a_sweep_tells_where_the_trap_is(fourier: Fourier) -> None:
    here, focus = bench(), np.linspace(-3.0, 3.0, 9)
    bead = here.bead(fourier)
    for height in (-0.7, 0.35):
        found = trap_plane(here.sweep(bead, focus, height), focus, bead, authored=height)
        assert agrees(found) and found.standard_error < 0.02


def test_refocusing_goes_as_far_as_it_says_where_indices_are_equal() -> None:
    found = calibrate(bench(immersion_index=1.33), pitch=2.2, device="cpu").results
    assert set(found) == {"pixel", "grid_angle", "pixel_by_stage", "stage_angle", "trap_plane", "depth_scale"}
    assert found["depth_scale"].authored == 1.0
    assert all(agrees(one) for one in found.values())


def test_a_mismatch_of_indices_shortens_depth() -> None:
    here = bench(numerical_aperture=0.6, pixel=0.14)
    found = calibrate(here, pitch=2.4, device="cpu").results["depth_scale"]
    paraxial, whole = 1.33 / 1.518, expected_depth_scale(here.microscope)
    # light fills the pupil in part: the scale is between that of the axis and that of the whole pupil
    assert whole < found.value < paraxial and found.standard_error < 0.005 and found.authored is None
    assert expected_depth_scale(Microscope(numerical_aperture=0.05)) == pytest.approx(paraxial, rel=1e-3)


def test_a_line_through_heights_has_its_standard_error() -> None:
    rng, heights = np.random.default_rng(3), np.linspace(1.0, 9.0, 9)
    found = [depth_scale(heights, heights / 0.88 + 0.02 * rng.standard_normal(9), authored=0.88) for _ in range(400)]
    off = np.array([(one.value - 0.88) / one.standard_error for one in found])
    # Student's t with 7 degrees of freedom has the variance 7/5, that of 400 draws a standard error of about 0.15
    assert abs(off.mean()) < SIGMAS * (1.4 / 400) ** 0.5 and abs(off.var() - 1.4) < SIGMAS * 0.15
    inside = np.mean([one.low < 0.88 < one.high for one in found])
    assert abs(inside - 0.95) < SIGMAS * (0.95 * 0.05 / 400) ** 0.5


@pytest.mark.quick
def test_files_keep_everything(tmp_path: Path) -> None:
    kept = Calibration({"pixel": Measured.of(0.065, 1e-4, 10, "um", "size of a pixel", 0.065)}, {"seed": 3})
    again = load_calibration(kept.save(tmp_path / "c.json"))
    assert again == kept
    said = json.loads((tmp_path / "c.json").read_text())
    for change, message in (({"version": 2}, "version = 2; allowed: 1"), ({"format": "x"}, "is no calibration"),
                            ({"results": {"pixel": {}}}, "results cannot be read")):  # fmt: skip
        (tmp_path / "c.json").write_text(json.dumps(said | change))
        with pytest.raises(InputError, match=message):
            load_calibration(tmp_path / "c.json")
    with pytest.raises(InputError, match="cannot be read"):
        load_calibration(tmp_path / "absent.json")


def test_nonsense_is_refused(fourier: Fourier) -> None:
    here = bench()
    with pytest.raises(InputError, match="pitch is 9 µm; allowed: "):
        here.grid(9.0, 0.0, fourier)
    with pytest.raises(InputError, match="dots; allowed: 9 or more"):
        pixel_of_grid(np.random.default_rng(0).normal(1.0, 0.01, (64, 64)) > 1e9, 2.0)
    with pytest.raises(InputError, match="allowed: four images or more"):
        pixel_of_steps(np.ones((2, 8, 8)), np.zeros((2, 2)))
    with pytest.raises(InputError, match="stage stands still"):
        pixel_of_steps(np.ones((4, 8, 8)), np.zeros((4, 2)))
    with pytest.raises(InputError, match="three or more, at heights that differ"):
        depth_scale(np.ones(4), np.ones(4))
    with pytest.raises(InputError, match="for 3 positions of the focus"):
        trap_plane(np.ones((3, 8, 8)), np.zeros(3), here.bead(fourier))


@pytest.mark.quick
@pytest.mark.parametrize("pitch", ["50", "1000", "1e-9"])
def test_a_grid_that_does_not_fit_is_refused_in_a_line(
    pitch: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main(["vision", "calibrate", SCENE, "--pitch", pitch, "-o", str(tmp_path / "c.json")]) == 2
    assert capfd.readouterr().err == (
        f"otwarp: --pitch is {float(pitch):g} µm; allowed: 0.952 to 2.5 µm, resolved and four times in the image\n"
    )
    assert not list(tmp_path.iterdir())


@pytest.mark.quick
def test_a_camera_that_resolves_no_grid_is_refused_in_a_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    scene = tmp_path / "dim.usda"
    aperture = "ot:camera:numericalAperture = "
    scene.write_text(Path(SCENE).read_text(encoding="utf-8").replace(aperture + "1.45", aperture + "0.2"))
    assert main(["vision", "calibrate", str(scene), "-o", str(tmp_path / "c.json")]) == 2
    said = capfd.readouterr().err
    assert said.startswith("otwarp: numericalAperture of the camera is 0.2, with which no grid ")
    assert said.endswith(" allowed: 0.506 or more\n") and said.count("\n") == 1
