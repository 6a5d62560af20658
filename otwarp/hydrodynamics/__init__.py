"""Hydrodynamics of rigid sphere assemblies: pair mobilities, body mobility and centre of diffusion (float64)."""

from __future__ import annotations

from otwarp.hydrodynamics.mobility import BodyMobility, body_mobilities, body_mobility, from_override
from otwarp.hydrodynamics.rpy import grand_mobility

__all__ = ["BodyMobility", "body_mobilities", "body_mobility", "from_override", "grand_mobility"]
