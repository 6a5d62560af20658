"""Pack reference forces into `reference.npz`, and read them back.

    python -m tests.optics.pack_reference FOLDER

FOLDER holds `summary.csv` and, per case, `<case>_{axial,radial_x,radial_y,random}.csv`: sphere centre relative to the
focus [µm] and force efficiency Q, computed with the Optical Tweezers Toolbox (Nieminen et al. 2007, J. Opt. A 9 S196,
doi:10.1088/1464-4258/9/8/S12). Only numbers are kept.
"""

from __future__ import annotations

import csv
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from otwarp.optics.beam import Beam
from otwarp.optics.mie import Particle

FILE = Path(__file__).with_name("reference.npz")
PARTS = ("axial", "radial_x", "radial_y", "random")


@dataclass(frozen=True, eq=False)
class Case:
    """One beam and sphere with reference values."""

    name: str
    beam: Beam
    sphere: Particle
    points: np.ndarray
    force: np.ndarray
    equilibrium: float
    stiffness: np.ndarray


def pack(folder: Path) -> None:
    """Write `reference.npz` from the toolbox's CSV files."""
    arrays = {}
    for row in csv.DictReader((folder / "summary.csv").read_text().splitlines()):
        name = row["name"]
        table = np.concatenate(
            [np.loadtxt(folder / f"{name}_{p}.csv", delimiter=",", skiprows=1)[:, :6] for p in PARTS]
        )
        about = [float(row[k]) for k in ("n_particle", "n_medium", "r_um", "lambda0_um", "NA")]
        result = [float(row[k]) for k in ("z_eq_um", "kx_pN_um_mW", "ky_pN_um_mW", "kz_pN_um_mW")]
        arrays[name], arrays[f"{name}.about"] = table, np.array(about + result)
    np.savez_compressed(FILE, **arrays)


def cases() -> list[Case]:
    """All reference cases."""
    out = []
    with np.load(FILE) as file:
        for name in [n for n in file.files if not n.endswith(".about")]:
            about, table = file[f"{name}.about"], file[name]
            kind = "aplanatic" if "aplanatic" in name else "sine" if "sintrunc" in name else "gaussian"
            beam = Beam(
                kind=kind,
                medium_index=about[1],
                wavelength=about[3],
                numerical_aperture=about[4],
                polarization="x" if "xlin" in name else "circular",
            )
            sphere = Particle(radius=about[2], index=about[0])
            out.append(Case(name, beam, sphere, table[:, :3], table[:, 3:], about[5], about[6:]))
    return out


if __name__ == "__main__":
    pack(Path(sys.argv[1]))
