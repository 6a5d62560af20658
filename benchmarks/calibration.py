"""Stiffness by the power spectrum, beside lumicks.pylake on the same tracks: `python -m benchmarks.calibration`.

Tracks are exact, of a bead whose stiffness is known. Both programs take the drag as known (Stokes) and fit the corner
frequency, each over the frequencies that its model holds for. Where this environment has no lumicks.pylake,
`--pylake PYTHON` names an interpreter of one that has.
"""

from __future__ import annotations

import importlib.util
import json
import math
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.report import Section, command
from otwarp.analysis import Detector, fit_spectrum, harmonic_tracks
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.errors import InputError

RADIUS, VISCOSITY, TEMPERATURE = 0.5, 0.89e-3, 298.15
DRAG = 6.0 * math.pi * VISCOSITY * RADIUS
SCRIPT = Path(__file__).with_name("pylake_fit.py")
PERFECT = Detector()
FINER = 16
"""Steps of the exact track for a sample, where a detector averages or filters."""


@dataclass(frozen=True)
class Case:
    """One way of recording a bead.

    Attributes:
        name: For the table.
        stiffness: [pN/µm].
        rate: Samples per second [1/s].
        samples: Of a track.
        high: Highest frequency of pylake's fit, whose model knows no aliasing [Hz].
        detector: Exposure, or a diode.
    """

    name: str
    stiffness: float
    rate: float
    samples: int
    high: float
    detector: Detector = PERFECT


CASES = (
    Case("78 kHz, fast detector, up to 5 kHz", 30.0, 78_125.0, 2**16, 5_000.0),
    Case("78 kHz, fast detector, up to 23 kHz", 30.0, 78_125.0, 2**16, 23_000.0),
    Case("78 kHz, photodiode of 8 kHz", 30.0, 78_125.0, 2**16, 23_000.0, Detector(cutoff=8_000.0)),
    Case("4 kHz, fast detector, up to 1 kHz", 30.0, 4_000.0, 2**15, 1_000.0),
    Case("4 kHz, fast detector, all frequencies", 30.0, 4_000.0, 2**15, 2_000.0),
    Case("1 kHz camera, exposed all the time", 10.0, 1_000.0, 2**14, 500.0, Detector(exposure=1e-3)),
)


def tracks_of(case: Case, count: int) -> np.ndarray:
    """(count, samples) tracks as the case's detector records them [µm]."""
    d = case.detector
    fine = FINER if d.exposure or math.isfinite(d.cutoff) else 1
    out = []
    for seed in range(count):
        x = harmonic_tracks(
            [case.stiffness],
            DRAG,
            1.0 / (case.rate * fine),
            fine * (case.samples + 128),
            temperature=TEMPERATURE,
            seed=seed,
        )
        seen = Detector(rate=case.rate, exposure=d.exposure, cutoff=d.cutoff).see(x) if fine > 1 else x
        out.append(seen.values[0, -case.samples :, 0])
    return np.array(out)


def ours(case: Case, tracks: np.ndarray) -> np.ndarray:
    """(count, 2) stiffness and its error [pN/µm]."""
    from otwarp.analysis import track

    found = []
    for x in tracks:
        fit = fit_spectrum(
            track(x, 1.0 / case.rate), temperature=TEMPERATURE, drag=DRAG, detector=case.detector, level=0.6827
        )
        found.append((float(fit["stiffness"][0]), 0.5 * float(fit["stiffness_high"][0] - fit["stiffness_low"][0])))
    return np.array(found)


def theirs(case: Case, tracks: np.ndarray, python: str) -> tuple[np.ndarray, dict[str, str]]:
    """(count, 2) stiffness and its error by pylake [pN/µm], and the versions of what computed it."""
    about = {
        "rate": case.rate, "diameter": 2.0 * RADIUS, "celsius": TEMPERATURE - 273.15, "viscosity": VISCOSITY,
        "low": 10.0, "high": case.high, "block": 64,
        "diode": case.detector.cutoff if math.isfinite(case.detector.cutoff) else 0.0,
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "tracks.npz"
        np.savez(file, tracks=tracks, **about)
        done = subprocess.run([python, str(SCRIPT), str(file)], capture_output=True, text=True)
    if done.returncode:
        raise InputError(f"--pylake is {python}; allowed: a Python with lumicks.pylake ({done.stderr.strip()[-200:]})")
    said = json.loads(done.stdout.splitlines()[-1])
    return np.array(said["fits"]), said["versions"]


def measure(device: str = "cpu", *, rounds: int = 12, pylake: str | None = None) -> Section:
    """Ratios of fitted to true stiffness, and of scatter to stated error, of both programs."""
    from otwarp.device import pick_device

    machine = Machine.look(pick_device(device))
    python = pylake or (sys.executable if importlib.util.find_spec("lumicks") else None)
    rows, data, versions = [], {}, {}
    for case in CASES:
        tracks = tracks_of(case, rounds)
        fits = {"otwarp": ours(case, tracks)}
        if python is not None:
            fits["pylake"], versions = theirs(case, tracks, python)
        data[case.name] = {name: (f / case.stiffness).tolist() for name, f in fits.items()}
        rows.append((case.name, *_cells(case, fits)))
    said = ", ".join(f"{name} {version}" for name, version in versions.items())
    table = Table(
        title="Stiffness by the power spectrum over the true one",
        head=(
            "recording",
            "otwarp",
            "scatter over stated error",
            "pylake",
            "scatter over stated error",
            "pylake over otwarp",
        ),
        rows=rows,
        note=f"Mean ± standard error of {rounds} exact tracks each. {said or 'lumicks.pylake is not installed'}; least "
        "squares with its bias correction, from 10 Hz up, blocks of 64 points.",
    )
    return Section(name="calibration", kind="cpu", machine=machine, tables=[table], data=data)


def _cells(case: Case, fits: dict[str, np.ndarray]) -> list[str]:
    cells = []
    for name in ("otwarp", "pylake"):
        if name not in fits:
            cells += ["", ""]
            continue
        value, error = fits[name].T / case.stiffness
        spread = value.std(ddof=1)
        cells += [f"{value.mean():.4f} ± {spread / math.sqrt(len(value)):.4f}", f"{spread / error.mean():.2f}"]
    both = fits.get("pylake")
    ratio = None if both is None else both[:, 0] / fits["otwarp"][:, 0]
    cells.append("" if ratio is None else f"{ratio.mean():.4f} ± {ratio.std(ddof=1) / math.sqrt(len(ratio)):.4f}")
    return cells


if __name__ == "__main__":
    command(
        measure,
        "Stiffness by the power spectrum, beside lumicks.pylake.",
        rounds=12,
        pylake={"metavar": "PYTHON", "help": "an interpreter that has lumicks.pylake"},
    )
