"""The description of a machine that lacks what a benchmark does not need."""

from __future__ import annotations

import importlib.metadata

from otwarp.bench.machine import Machine
from otwarp.device import pick_device


def test_a_package_that_is_not_installed_is_left_out(monkeypatch):
    known = importlib.metadata.version

    def version(name: str) -> str:
        if name == "usd-core":
            raise importlib.metadata.PackageNotFoundError(name)
        return known(name)

    monkeypatch.setattr(importlib.metadata, "version", version)
    machine = Machine.look(pick_device("cpu"))
    assert set(machine.versions) == {"Python", "Warp", "NumPy"}
    assert machine.name() == machine.processor
