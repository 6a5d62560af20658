"""Optical forces: beams as angular spectra, Mie scattering, exact forces, their tables, and fits of their curves.

Float64 throughout: NumPy, and a Warp kernel for large sets of points. Nothing here knows a scene. In comes a `Beam` and
a `Particle`, out come forces: lengths in µm, powers in mW, forces as dimensionless Q or in pN (`Beam.force_scale`·Q).

Floor plan, each file importing only from those above it; to begin with, open `beam` and `exact`:

    beam, mie            what is given: the light's spectrum; a sphere and its Mie coefficients
    harmonics            angular functions and the operators of momentum flux
    exact, batched       the exact force: NumPy with torque and error estimate; a Warp device for many points
    field                `force`, whichever of the two computes it
    analysis, fit        what a field means for a trap: equilibrium, stiffness, escape; the force laws that fit it
    table, table_cache   a field as nested (ρ, z) grids; kept on disk
    table_build          the making of a table
    models               the ladder of force models, from exact down to a spring
    curves, maps         pictures of all models, and of the basin of attraction
    points               points and forces as CSV files
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from otwarp.lazy import lazy_names

if TYPE_CHECKING:
    from otwarp.optics.analysis import TrapProperties as TrapProperties
    from otwarp.optics.analysis import axial_equilibria as axial_equilibria
    from otwarp.optics.analysis import stiffness as stiffness
    from otwarp.optics.analysis import trap_properties as trap_properties
    from otwarp.optics.beam import Beam as Beam
    from otwarp.optics.exact import Evaluation as Evaluation
    from otwarp.optics.exact import evaluate as evaluate
    from otwarp.optics.field import Field as Field
    from otwarp.optics.field import force as force
    from otwarp.optics.fit import CurveFit as CurveFit
    from otwarp.optics.fit import fit_harmonic as fit_harmonic
    from otwarp.optics.fit import fit_piecewise as fit_piecewise
    from otwarp.optics.fit import trap_region as trap_region
    from otwarp.optics.maps import ForceMap as ForceMap
    from otwarp.optics.maps import basin_reach as basin_reach
    from otwarp.optics.maps import force_map as force_map
    from otwarp.optics.mie import Particle as Particle
    from otwarp.optics.models import Ladder as Ladder
    from otwarp.optics.table import ForceTable as ForceTable
    from otwarp.optics.table_build import build_table as build_table

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "analysis": ("TrapProperties", "axial_equilibria", "stiffness", "trap_properties"),
        "beam": ("Beam",),
        "exact": ("Evaluation", "evaluate"),
        "field": ("Field", "force"),
        "fit": ("CurveFit", "fit_harmonic", "fit_piecewise", "trap_region"),
        "maps": ("ForceMap", "basin_reach", "force_map"),
        "mie": ("Particle",),
        "models": ("Ladder",),
        "table": ("ForceTable",),
        "table_build": ("build_table",),
    },
)
