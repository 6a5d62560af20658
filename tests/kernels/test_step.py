"""A term that a scene lacks is not in the generated source, not launched and not allocated.

Source is generated, not compiled, so many feature sets cost little.
"""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
import warp as wp
from warp._src.context import ModuleBuilder

from otwarp.kernels.core.features import Features
from otwarp.kernels.step import make_step
from otwarp.laws import TrapLaw
from otwarp.scene import Flow, Scene, Settings
from otwarp.simulation.simulation import Simulation
from otwarp.warp_internals import fields
from tests.kernels.skip_cases import BASE, CASES
from tests.simulation.setups import bead_scene, contact_scene, harmonic, neutral, robot, sphere_body


@cache
def source(features: Features) -> str:
    """C++ of all kernels of a step without comments, which quote Python lines even of branches left out."""
    text = []
    for kernel in make_step(features).kernels:
        options = kernel.module.resolve_options(wp.config, block_dim=1) | {"output_arch": None}
        code = ModuleBuilder(kernel.module, options, target="cpu").codegen("cpu")
        text += [line.split("//")[0] for line in code.splitlines()]
    return "\n".join(text)


@pytest.mark.parametrize("term", CASES)
def test_source_holds_what_is_needed_and_no_more(term, device):
    with_, without, names = CASES[term]
    there, gone = source(with_), source(without)
    assert [n for n in names if n not in there] == []
    assert [n for n in names if n in gone] == []


def test_the_least_step_holds_nothing_optional(device):
    """A free sphere without noise: of all functions of the cases only its own move in one stage is left."""
    least = source(dataclasses.replace(BASE, brownian=False, integrator="eulerMaruyama"))
    left = {n for _, _, names in CASES.values() for n in names if n in least}
    assert left == {"bead_constants", "predict_euler_maruyama"}


def test_equal_features_share_their_kernels(device):
    assert make_step(Features()) is make_step(Features())
    sims = [Simulation(bead_scene(), worlds=w, device=device) for w in (1, 3)]
    assert sims[0]._step is sims[1]._step


def lengths(sim: Simulation) -> dict[str, int]:
    """Number of elements of every device array, by group and name."""
    data = sim.model.data
    groups = {
        "state": sim.state, "readout": sim.readout, "traps": data.traps, "body": data.body, "contact": data.contact,
        "obstacles": data.obstacles, "flow": data.flow, "coupling": data.coupling,
    }  # fmt: skip
    out = {}
    for group, item in groups.items():
        arrays = vars(item) if group in ("state", "readout") else fields(item)
        out |= {f"{group}.{n}": v.size for n, v in arrays.items() if isinstance(v, wp.array)}
    return out


def test_a_free_bead_allocates_nothing_optional(device):
    bead = Scene(bodies=(sphere_body("B", trapped=False),), settings=Settings(time_step=1e-3))
    sizes = lengths(Simulation(bead, device=device))
    used = {k for k, n in sizes.items() if n > 0}
    # besides pose and faults: its shape, its bounds, and the start offsets of tables that are themselves empty
    assert used == {
        "state.position", "readout.fault", "readout.fault_step", "readout.fault_count", "body.shape", "body.rigid",
        "body.translation", "body.bound", "body.largest", "body.trapped_start", "body.drag_start", "contact.start",
        "traps.key_start", "obstacles.key_start",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("change", "arrays"),
    [
        ({"traps": (harmonic("T", speed_limit=5.0),)}, ("traps.speed_limit", "state.trap_position")),
        (
            {"traps": (dataclasses.replace(harmonic("T"), axial=TrapLaw(stiffness=5.0)),)},
            ("traps.axial_stiffness", "traps.axial_cutoff"),
        ),
        ({"traps": (harmonic("T", cutoff=1.0),)}, ("readout.escape_step",)),
        ({"flow": Flow(prim="/World/F", kind="uniform", speed=1.0)}, ("flow.speed",)),
        ({"settings": Settings(gravity=True)}, ("body.weight",)),
        (
            {"bodies": (robot("B"), sphere_body("C", (9.0, 0, 0))), "settings": Settings(coupling=True)},
            ("coupling.radius", "coupling.given_turning", "coupling.with_turning", "coupling.turning_root"),
        ),
        ({"bodies": (robot("B"),)}, ("state.orientation", "body.mobility", "body.cholesky")),
    ],
    ids=["speed limit", "axial curve", "reach", "flow", "gravity", "coupling", "rotation"],
)
def test_arrays_come_with_their_term(change, arrays, device):
    from otwarp.simulation.model import Model
    from otwarp.simulation.state import Readout, State

    def sizes(scene: Scene) -> dict[str, int]:
        model = Model.build(scene, device=device)
        groups = {"state": State.start(model), "readout": Readout.empty(model)}
        out = {f"{g}.{n}": v.size for g, i in groups.items() for n, v in vars(i).items() if isinstance(v, wp.array)}
        for g in ("traps", "body", "flow", "coupling"):
            part = fields(getattr(model.data, g))
            out |= {f"{g}.{n}": v.size for n, v in part.items() if isinstance(v, wp.array)}
        return out

    without, with_ = sizes(bead_scene()), sizes(dataclasses.replace(bead_scene(), **change))
    for name in arrays:
        assert without[name] == 0, name
        assert with_[name] > 0, name


def test_one_launch_per_call(device, monkeypatch):
    """Solo and world drivers: a call of `step` is one kernel per worker, however many steps and worlds."""
    scenes = (bead_scene(), contact_scene(neutral("A", (0, 0, 9.0)), neutral("B", (9.0, 0, 9.0))))
    for scene, driver in zip(scenes, ("solo", "world"), strict=True):
        sim = Simulation(scene, worlds=4, device=device, threads=1)
        assert sim.model.features.driver == driver
        launched = []
        launch = wp.Launch.launch
        monkeypatch.setattr(wp.Launch, "launch", lambda one, to=launched, do=launch: (to.append(one.kernel), do(one)))
        sim.step(500)
        monkeypatch.undo()
        assert launched == [sim._step.fused]
        assert np.all(np.isfinite(sim.state.position.numpy()))
