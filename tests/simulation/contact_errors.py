"""How far contacts are from their laws, in float64 from what the device holds after a step.

The last free moves, contacts and loads are taken as they are; what the loads move, how far that opens each gap, and the
load that each contact would have with all others as they are, are found anew.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from otwarp.kernels.contact.contact import SETTLED
from otwarp.kernels.contact.excursion import PATH_TOLERANCE
from otwarp.kernels.drivers.grid.data import shares_entries, whole_contacts
from otwarp.kernels.drivers.grid.entries import (
    ANGULAR,
    ARM,
    DRIFT,
    GIVE,
    LAW,
    LINEAR,
    OTHER_ANGULAR,
    OTHER_ARM,
    OTHER_LINEAR,
    PATH,
    RIDGE,
)
from otwarp.simulation.simulation import Simulation
from tests.reference.contact_law import kept, load_alone

NOBODY = wp.vec2i(-9, -9)
"""Bodies of an entry that no step has made."""


def forget_entries(sim: Simulation) -> None:
    """Make the entries of the next step known by their bodies: their number is not kept."""
    grid: Any = sim._stepper.scratch  # pyright: ignore[reportAttributeAccessIssue]
    grid.entry.body.fill_(NOBODY)


def entries_of(sim: Simulation, world: int) -> dict[str, np.ndarray]:
    """What `contacts_of` finds, where threads shared out the contacts of the step after `forget_entries`."""
    grid: Any = sim._stepper.scratch  # pyright: ignore[reportAttributeAccessIssue]
    entry = grid.entry
    body = entry.body.numpy().reshape(sim.model.worlds, -1, 2)[world].astype(int)
    body = body[: np.count_nonzero(body[:, 0] >= 0)]
    part = entry.part.numpy().reshape(len(entry.part), sim.model.worlds, -1, 4)[:, world, : len(body)].astype(float)
    load = entry.load.numpy().reshape(sim.model.worlds, -1)[world, : len(body)].astype(float)
    found = {"a": body[:, 0], "b": body[:, 1], "load": load, "normal": part[LAW, :, :3], "drift": part[DRIFT, :, :3]}
    found |= {"overlap": part[LAW, :, 3], "lift": part[DRIFT, :, 3]}
    found |= dict(zip(("give", "hardness", "floor"), part[GIVE].T[:3], strict=True))
    found |= dict(zip(("wander", "layer"), part[PATH].T[:2], strict=True))
    own = part[RIDGE, :, 3]
    for side, arm, linear, angular, share in (
        ("a", ARM, LINEAR, ANGULAR, own),
        ("b", OTHER_ARM, OTHER_LINEAR, OTHER_ANGULAR, own - found["give"]),
    ):
        if whole_contacts(sim.model.features):
            found[f"arm_{side}"] = part[arm, :, :3]
            found[f"linear_{side}"], found[f"angular_{side}"] = part[linear, :, :3], part[angular, :, :3]
        else:
            found[f"arm_{side}"] = found[f"angular_{side}"] = np.zeros((len(body), 3))
            found[f"linear_{side}"] = share[:, None] * found["normal"]
    return found


def contacts_of(sim: Simulation, world: int) -> dict[str, np.ndarray]:
    """The listed contacts of a world, field by field in float64, with the body `a` that lists each.

    Those of lone spheres are kept without arms and rotations, and with one response along the normal.
    """
    grid: Any = sim._stepper.scratch  # pyright: ignore[reportAttributeAccessIssue]
    count = grid.count.numpy()[world]
    bodies = np.arange(len(count)).repeat(count)
    place = np.concatenate([np.arange(n) for n in count])
    whole = whole_contacts(sim.model.features)
    rows = (grid.contact if whole else grid.link).numpy()[world * len(count) + bodies, place]
    names = ["normal", "overlap", "hardness", "floor", "drift", "lift", "give", "wander", "layer", "load"]
    found = {name: rows[name].astype(float) for name in names}
    found |= {"a": bodies, "b": rows["b"].astype(int)}
    for part, share in (("a", None if whole else rows["own"]), ("b", None if whole else rows["own"] - rows["give"])):
        if share is None:
            found[f"arm_{part}"] = rows[f"arm_{part}"].astype(float)
            for name in ("linear", "angular"):
                found[f"{name}_{part}"] = rows[f"response_{part}"][name].astype(float)
        else:
            found[f"arm_{part}"] = found[f"angular_{part}"] = np.zeros((len(rows), 3))
            found[f"linear_{part}"] = share.astype(float)[:, None] * found["normal"]
    return found


def openings(sim: Simulation, world: int, c: dict[str, np.ndarray]) -> np.ndarray:
    """(n,) how far free moves, all loads and the lift open the gaps in the last step [µm]."""
    grid: Any = sim._stepper.scratch  # pyright: ignore[reportAttributeAccessIssue]
    linear = grid.linear.numpy()[world].astype(float)
    angular = grid.angular.numpy()[world].astype(float) if sim.model.features.rigid else np.zeros_like(linear)
    met = c["b"] >= 0
    for part, some in (("a", np.ones_like(met)), ("b", met)):
        for total, name in ((linear, "linear"), (angular, "angular")):
            np.add.at(total, c[part][some], (c["load"][:, None] * c[f"{name}_{part}"])[some])
    opened = c["lift"] - np.sum(c["drift"] * c["normal"], axis=1)
    for part, sign in (("a", 1.0), ("b", np.where(met, -1.0, 0.0))):
        move = linear[c[part]] + np.cross(angular[c[part]], c[f"arm_{part}"])
        opened += sign * np.sum(move * c["normal"], axis=1)
    return opened


def contact_errors(sim: Simulation, world: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(n,) loads [pN], errors [µm] and tolerances [µm] of the contacts of a world in the step that was taken last.

    An error is what the load that is missing, or too much, would move. A path has its tolerance as long as it, or the
    load that it left, asks for something: within the error of the place where Hertz's law takes over.
    """
    c = (entries_of if shares_entries(sim.model.features) else contacts_of)(sim, world)
    apart = openings(sim, world, c) - c["give"] * (c["load"] - c["floor"])
    hertz, path = kept(apart, c["overlap"], c["wander"], c["layer"])
    out = np.maximum(hertz, path)
    alone = c["floor"] + load_alone(out, c["hardness"], c["give"])
    error = np.abs(alone - c["load"]) * c["give"]
    drawn = (path > hertz - error) & ((out > 0.0) | (c["load"] > c["floor"]))
    above = 0.5 * (apart + np.sqrt(apart**2 + c["wander"]))
    return c["load"], error, SETTLED + np.where(drawn, PATH_TOLERANCE * above, 0.0)
