"""Hydrodynamics of rigid bodies: pair mobilities, surface blobs, body mobility, centre of diffusion (float64)."""

from __future__ import annotations

from otwarp.hydrodynamics.mobility import body_mobility, from_override
from otwarp.hydrodynamics.rigid import BodyMobility
from otwarp.hydrodynamics.rpy import grand_mobility

__all__ = ["BodyMobility", "body_mobility", "from_override", "grand_mobility"]
