"""`Method`: how a run was computed, as its files say."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from otwarp.simulation.model import Model


@dataclass(frozen=True, kw_only=True)
class Method:
    """What two runs of one scene with one seed and time step may still differ in.

    Attributes:
        precision: Of all numbers but the noise, `float32` or `float64`; `run.nc` is in the same.
        integrator: The one that served, which may be a simpler one than was asked for.
        noise: Distribution of the thermal noise, `none` without it.
        fast_math: Whether approximate instructions were allowed.
        crossings: Whether escapes between the ends of two steps counted.
        coupling: Whether bodies carried each other along through the liquid.
        driver: Which form of the step ran: `solo`, `world` or `grid`.
        device: Warp's name of the device, `cpu`, `cuda:0`, …
        device_name: What kind of device that was.
        forces: Forces with parameters per body that acted, the scene's and the user's: name → digest
            (`otwarp.kernels.body_forces.body_force.BodyForce`). Files of runs without any do not mention them.
    """

    precision: str
    integrator: str
    noise: str
    fast_math: bool
    crossings: bool
    coupling: bool
    driver: str
    device: str
    device_name: str
    forces: Mapping[str, str] = field(default_factory=dict, hash=False)

    @classmethod
    def of(cls, model: Model) -> Method:
        """How the steps of a model are computed."""
        f = model.features
        return cls(
            precision=f.precision,
            integrator=f.integrator,
            noise=f.noise if f.brownian else "none",
            fast_math=f.fast_math,
            crossings=f.crossings,
            coupling=f.coupling,
            driver=f.driver,
            device=str(model.device.alias),
            device_name=str(model.device.name),
            forces={force.name: force.digest for force in model.forces.body_forces},
        )

    @classmethod
    def read(cls, attributes: Mapping[str, Any]) -> Method | None:
        """From the attributes of a file, as `attributes` made them; None if it does not say."""
        fields = [f for f in dataclasses.fields(cls) if f.name != "forces"]
        if not all(field.name in attributes for field in fields):
            return None
        values: dict[str, Any] = {f.name: (bool if f.type == "bool" else str)(attributes[f.name]) for f in fields}
        return cls(**values, forces=json.loads(attributes.get("forces", "{}")))

    def facts(self) -> dict[str, Any]:
        """All fields as plain data, as a summary says them; `forces` only where there are any."""
        said = dataclasses.asdict(self)
        return said if self.forces else {k: v for k, v in said.items() if k != "forces"}

    def attributes(self) -> dict[str, str | int]:
        """As attributes of a file: netCDF-3 knows no booleans, 0 and 1 stand for them; forces are JSON."""
        said = self.facts()
        if self.forces:
            said["forces"] = json.dumps(said["forces"])
        return {k: int(v) if isinstance(v, bool) else v for k, v in said.items()}
