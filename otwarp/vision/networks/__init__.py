"""Networks that say where a robot is and how it lies.

estimate    what is said of an image: `Estimate`
modules     the networks themselves, of torch
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from otwarp.lazy import lazy_names

if TYPE_CHECKING:
    from otwarp.vision.networks.estimate import QUANTITIES as QUANTITIES
    from otwarp.vision.networks.estimate import Estimate as Estimate

__getattr__, __dir__ = lazy_names(__name__, {"estimate": ("QUANTITIES", "Estimate")})
