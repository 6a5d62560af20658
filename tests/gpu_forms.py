"""Steps in the forms for GPUs, on a CPU: what needs no GPU to fail, such as an index past an array's end.

Threads run one after the other here: what depends on their order shows on a GPU alone.
"""

from __future__ import annotations

import dataclasses

import pytest

from otwarp.kernels.core.features import Features
from otwarp.simulation import composition, model, resolved


def take_gpu_forms(patch: pytest.MonkeyPatch) -> None:
    """Bodies one by one instead of in lanes, contacts in sweeps instead of in turns, the world driver in phases."""
    composed = resolved.compose

    def compose(*args, **kwargs) -> Features:
        features = composed(*args, **kwargs)
        return dataclasses.replace(features, phased=composition._takes_phases(features))

    patch.setattr(resolved, "compose", compose)
    patch.setattr(composition, "_takes_lanes", lambda *about: False)
    patch.setattr(model, "takes_turns", lambda *about: False)
