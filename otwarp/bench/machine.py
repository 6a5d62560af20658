"""The class of machine a figure was measured on: what matters to speed, and nothing that names the machine."""

from __future__ import annotations

import contextlib
import importlib.metadata
import os
import platform
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import warp as wp

from otwarp.simulation.drivers.compilation import usable_cores


@dataclass(frozen=True)
class Machine:
    """Processor, cores, accelerator and versions.

    Attributes:
        processor: Model name, with family and model number where the name alone says little.
        cores: Cores this process may use.
        accelerator: Name of the CUDA device, or None.
        system: Operating system and architecture.
        versions: Of Python and those of the packages that do the work that are installed.
        load: One-minute load average when the benchmark began, None where the system does not tell.
    """

    processor: str
    cores: int
    accelerator: str | None
    system: str
    versions: dict[str, str]
    load: float | None

    @classmethod
    def look(cls, device: wp.Device) -> Machine:
        """The machine this process runs on, with `device` as its accelerator if it is one."""
        versions = {"Python": platform.python_version()}
        for label, package in (("Warp", "warp-lang"), ("USD", "usd-core"), ("NumPy", "numpy")):
            # USD is not needed to step a scene that was not read from a stage
            with contextlib.suppress(importlib.metadata.PackageNotFoundError):
                versions[label] = importlib.metadata.version(package)
        return cls(
            processor=_processor(),
            cores=usable_cores(),
            accelerator=None if device.is_cpu else device.name,
            system=f"{platform.system()} {platform.machine()}",
            versions=versions,
            load=round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None,
        )

    def name(self) -> str:
        """What did the work: the accelerator if there is one, else the processor."""
        return self.accelerator or self.processor

    @property
    def kind(self) -> str:
        """`cpu` or `cuda`."""
        return "cuda" if self.accelerator else "cpu"

    def about(self, *, fast_math: bool = False) -> dict[str, Any]:
        """The fields of `otwarp.bench.findings.Findings` that are about the machine, for JSON."""
        hardware = self.name() + (", fast math" if fast_math else "")
        return {"kind": self.kind, "hardware": hardware, "machine": self.data()}

    def text(self) -> str:
        """One line for people."""
        parts = [self.processor, f"{self.cores} cores"]
        if self.accelerator:
            parts.insert(0, self.accelerator)
        parts += [self.system, *(f"{k} {v}" for k, v in self.versions.items())]
        if self.load is not None:
            parts.append(f"load {self.load:g} at the start")
        return ", ".join(parts)

    def data(self) -> dict[str, object]:
        """All fields as plain data, for JSON."""
        return asdict(self)


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    facts: dict[str, str] = {}
    for line in lines:
        key, _, value = line.partition(":")
        facts.setdefault(key.strip(), value.strip())
    name = facts.get("model name") or platform.machine()
    if {"cpu family", "model"} <= facts.keys():
        name += f" (family {facts['cpu family']}, model {facts['model']})"
    return name
