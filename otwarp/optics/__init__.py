"""Optical forces: beams as angular spectra, Mie scattering, exact forces, their tables, and fits of their curves.

Float64 throughout: NumPy, and a Warp kernel for large sets of points. Nothing here knows a scene.
"""

from otwarp.optics.analysis import TrapProperties, stiffness, trap_properties
from otwarp.optics.beam import Beam
from otwarp.optics.exact import Evaluation, evaluate, force
from otwarp.optics.fit import CurveFit, PiecewiseLaw, fit_harmonic, fit_piecewise
from otwarp.optics.mie import Sphere
from otwarp.optics.models import Ladder
from otwarp.optics.table import ForceTable

__all__ = [
    "Beam",
    "CurveFit",
    "Evaluation",
    "ForceTable",
    "Ladder",
    "PiecewiseLaw",
    "Sphere",
    "TrapProperties",
    "evaluate",
    "fit_harmonic",
    "fit_piecewise",
    "force",
    "stiffness",
    "trap_properties",
]
