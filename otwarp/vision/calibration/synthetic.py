"""`calibrate`: all targets rendered, recorded with noise, and measured from their images alone."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from otwarp.vision.calibration.displacement import pixel_of_steps
from otwarp.vision.calibration.file import Calibration
from otwarp.vision.calibration.lattice import pixel_of_grid
from otwarp.vision.calibration.planes import depth_scale, expected_depth_scale, fit_sweep, trap_plane
from otwarp.vision.calibration.targets import Bench
from otwarp.vision.fourier import Fourier

HEIGHTS = (2.0, 4.0, 6.0, 8.0, 10.0)
"""Of stuck beads below the cover glass [µm]."""


def calibrate(
    bench: Bench,
    *,
    pitch: float = 2.0,
    angle: float = 3.0,
    trap_height: float = 0.4,
    device: str | None = None,
    say: Callable[[str], None] | None = None,
) -> Calibration:
    """Look at a grid, at a bead moved by a stage, at a trapped one and at stuck ones; measure each from its images.

    Args:
        bench: Microscope and sensor.
        pitch: Of the grid [µm].
        angle: Of grid and stage against the camera [deg].
        trap_height: Of the trap plane above the camera's own focal plane [µm].
        device: Where; None: a GPU if there is one.
        say: Called with what is being looked at.

    Raises:
        InputError: A target that does not fit the image.
    """
    tell, fourier, m = say or (lambda what: None), Fourier(device), bench.microscope
    bench.check_pitch(pitch)
    results: dict[str, Any] = {}
    tell("grid")
    pixel, turned = pixel_of_grid(bench.grid(pitch, angle, fourier), pitch, authored=m.pixel)
    results["pixel"] = pixel
    results["grid_angle"] = dataclasses.replace(turned, authored=angle)
    bead = bench.bead(fourier)
    tell("steps of the stage")
    room = 0.5 * bench.width * m.pixel - 2.5 * bench.bead_radius
    ends = np.linspace(-1.0, 1.0, 5) * min(2.0, max(room, 2.0 * m.pixel))
    stage = np.array([(x, y) for x in ends for y in ends])
    turn = np.radians(angle)
    seen = stage @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    results["pixel_by_stage"], turned = pixel_of_steps(bench.steps(bead, seen), stage, authored=m.pixel)
    results["stage_angle"] = dataclasses.replace(turned, authored=angle)
    tell("trapped bead")
    focus = np.linspace(-3.0, 3.0, 9)
    results["trap_plane"] = trap_plane(bench.sweep(bead, focus, trap_height), focus, bead, authored=trap_height)
    expected = expected_depth_scale(m)
    found = []
    for height in HEIGHTS:
        tell(f"stuck bead at {height:g} µm")
        nominal = height / expected + np.linspace(-2.5, 2.5, 9)
        # refocusing deeper is down
        sweep = fit_sweep(bench.refocused(bead, nominal, height), -nominal, bead, scaled=True)
        found.append(-sweep.focus)
    # with another immersion no one number is what was authored: the scale goes with the angle of light
    same = 1.0 if abs(m.immersion_index - m.medium_index) < 1e-6 else None
    results["depth_scale"] = depth_scale(np.array(HEIGHTS), np.array(found), authored=same)
    return Calibration(results, _source(bench, pitch))


def _source(bench: Bench, pitch: float) -> dict[str, Any]:
    optics = dataclasses.asdict(bench.microscope)
    optics["zernike"] = {str(noll): rms for noll, rms in bench.microscope.zernike.items()}
    sensor = {n: v if np.isfinite(v) else str(v) for n, v in dataclasses.asdict(bench.sensor).items()}
    return {"targets": "synthetic: a grid of dots and beads, rendered and recorded with noise", "pitch": pitch,
            "heights": list(HEIGHTS), "width": bench.width, "bead_radius": bench.bead_radius,
            "bead_index": bench.bead_index, "seed": bench.seed, "optics": optics, "sensor": sensor,
            "depth_scale_paraxial": bench.microscope.medium_index / bench.microscope.immersion_index,
            "depth_scale_whole_pupil": expected_depth_scale(bench.microscope)}  # fmt: skip
