"""The two gains of a hand that may change in mid-run."""

from __future__ import annotations

from otwarp.haptics.core.config import HandConfig
from otwarp.haptics.core.fields import check_value

Gains = tuple[float | None, float | None]
"""Motion gain [µm/m] and force gain [N/pN]; None for as configured."""


def checked_gains(motion_gain: float | None, force_gain: float | None) -> Gains:
    """Gains within the ranges of `config.HandConfig`.

    Raises:
        InputError: Out of range.
    """
    fields = HandConfig.__dataclass_fields__
    for name, value in (("motion_gain", motion_gain), ("force_gain", force_gain)):
        if value is not None:
            check_value(f"hand.{name}", value, float, fields[name].metadata)
    return motion_gain, force_gain
