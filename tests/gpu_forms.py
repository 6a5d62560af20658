"""Steps in the forms for GPUs, on a CPU: what needs no GPU to fail, such as an index past an array's end.

Threads run one after the other here: what depends on their order shows on a GPU alone.
"""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any

import pytest

from otwarp.kernels.core.features import Features
from otwarp.kernels.optics import thread_rows
from otwarp.simulation import composition, model, resolved
from otwarp.simulation.drivers.world_scratch import keeps_contacts, many_in_phases, team_for


def take_gpu_forms(patch: pytest.MonkeyPatch) -> None:
    """Bodies one by one instead of in lanes, contacts in sweeps instead of in turns, steps in phases.

    A bead before an obstacle has its contacts in local arrays, as in many worlds; phases have teams, as in few.
    """
    composed = resolved.compose

    def compose(*args, **kwargs) -> Features:
        features = composed(*args, **kwargs)
        return dataclasses.replace(
            features,
            phased=composition._takes_phases(features),
            cached=False,
            listed=composition._lists_traps(features),
        )

    patch.setattr(resolved, "compose", compose)
    patch.setattr(thread_rows, "LOCAL", thread_rows.ROWS)
    patch.setattr(composition, "_takes_lanes", lambda *about: False)
    patch.setattr(composition, "_takes_blocks", lambda *about: False)
    patch.setattr(model, "takes_turns", lambda *about: False)
    gpu: Any = SimpleNamespace(is_cuda=True, sm_count=1)
    patch.setattr(model, "keeps_contacts", lambda f, worlds, device: keeps_contacts(f, 1_000, gpu))
    patch.setattr(model, "many_in_phases", lambda f, worlds, device: many_in_phases(f, 1_000, gpu))
    patch.setattr(model, "team_for", lambda f, worlds, device: team_for(f, 1, gpu))
