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
from tests.simulation.setups import bead_scene, contact_scene, harmonic, neutral, robot, sphere_body

BASE = Features()
"""A lone sphere with noise, and nothing else."""
EVERYTHING = Features(
    driver="world", bodies=2, traps=3, rigid=True, gravity=True, flow="poiseuille", moving_traps=True,
    trap_models=("harmonic_isotropic", "harmonic_split", "piecewise_isotropic", "piecewise_split"), speed_limits=True,
    obstacles=("box", "capsule", "cylinder", "mesh", "plane", "sphere"), moving_obstacles=True, pairs=True,
    escapes=True,
)  # fmt: skip

SOFT_CROWD = dataclasses.replace(BASE, driver="grid", bodies=30, pairs=True, soft_contacts=True)
"""Spheres whose contacts are soft."""

CASES: dict[str, tuple[Features, Features, tuple[str, ...]]] = {
    # term: (with it, without it, functions that only it needs)
    "brownian": (BASE, dataclasses.replace(BASE, brownian=False), ("philox", "gaussian_pair", "noise_words")),
    "harmonic": (
        dataclasses.replace(BASE, traps=1, trap_models=("harmonic_isotropic",)),
        BASE,
        ("harmonic_isotropic", "harmonic_ratio", "law_scale", "commanded_still"),
    ),
    "piecewise": (
        dataclasses.replace(BASE, traps=1, trap_models=("piecewise_isotropic",)),
        dataclasses.replace(BASE, traps=1, trap_models=("harmonic_isotropic",)),
        ("piecewise_ratio",),
    ),
    "split": (
        dataclasses.replace(BASE, traps=1, trap_models=("harmonic_split",)),
        dataclasses.replace(BASE, traps=1, trap_models=("harmonic_isotropic",)),
        ("harmonic_split", ").axial_stiffness)"),
    ),
    "moving traps": (
        dataclasses.replace(BASE, traps=1, trap_models=("harmonic_isotropic",), moving_traps=True),
        dataclasses.replace(BASE, traps=1, trap_models=("harmonic_isotropic",)),
        ("commanded_animated", "find_key", "key_weight"),
    ),
    "speed limits": (
        EVERYTHING,
        dataclasses.replace(EVERYTHING, speed_limits=False),
        ("limited_focus",),
    ),
    "rotation": (
        dataclasses.replace(BASE, rigid=True, spheres=False),
        BASE,
        ("rigid_constants", "rotate_by", ").cholesky)"),
    ),
    "lone spheres": (EVERYTHING, dataclasses.replace(EVERYTHING, spheres=False), ("bead_constants", "sphere_response")),
    "uniform flow": (dataclasses.replace(BASE, flow="uniform"), BASE, ("uniform_flow",)),
    "shear flow": (dataclasses.replace(BASE, flow="shear"), dataclasses.replace(BASE, flow="uniform"), ("shear_flow",)),
    "poiseuille": (
        EVERYTHING,
        dataclasses.replace(EVERYTHING, flow=None),
        ("poiseuille_flow", "flow_velocity", ").flow_coupling)"),
    ),
    "gravity": (dataclasses.replace(BASE, gravity=True), BASE, (").weight)",)),
    "coupling": (
        dataclasses.replace(EVERYTHING, coupling=True),
        EVERYTHING,
        ("pair_mobility", "factorise_blocks", "carry_others", "carried_by", "fill_root"),
    ),
    "coupling without contact": (
        dataclasses.replace(BASE, driver="world", bodies=2, coupling=True, brownian=False),
        dataclasses.replace(BASE, driver="world", bodies=2, brownian=False),
        ("pair_mobility", "carry_others"),
    ),
    "noise of coupled bodies": (
        dataclasses.replace(BASE, driver="world", bodies=2, coupling=True),
        dataclasses.replace(BASE, driver="world", bodies=2, coupling=True, brownian=False),
        ("factorise_blocks", "fill_root", "philox"),
    ),
    "rotation of coupled bodies": (
        dataclasses.replace(BASE, driver="world", bodies=2, rigid=True, coupling=True),
        dataclasses.replace(BASE, driver="world", bodies=2, coupling=True),
        (").given_turning)", ").turning_root)", ").with_turning)", "mobility_product"),
    ),
    "escapes": (EVERYTHING, dataclasses.replace(EVERYTHING, escapes=False), ("record_escapes", ").held_range)")),
    "obstacles": (
        dataclasses.replace(EVERYTHING, pairs=False),
        dataclasses.replace(EVERYTHING, pairs=False, obstacles=(), moving_obstacles=False),
        ("obstacle_contacts", "box_distance", "mesh_distance", "hertz_dmt", "solve_contacts", "rigid_response"),
    ),
    "one shape of six": (
        EVERYTHING,
        dataclasses.replace(EVERYTHING, obstacles=("box",)),
        ("plane_distance", "ball_distance", "cylinder_distance", "capsule_distance", "mesh_distance"),
    ),
    "moving obstacles": (
        EVERYTHING,
        dataclasses.replace(EVERYTHING, moving_traps=False, moving_obstacles=False),
        ("moving_pose", "find_key"),
    ),
    "periodic axes": (dataclasses.replace(EVERYTHING, periodic=True), EVERYTHING, ("image_shift", "kept_in_cell")),
    "periodic grid": (
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30, periodic=True),
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30),
        ("image_shift", "kept_in_cell", "nearest"),
    ),
    "periodic beads": (dataclasses.replace(BASE, periodic=True), BASE, ("kept_in_cell", ").period)")),
    "inlet": (
        dataclasses.replace(EVERYTHING, inlet=True),
        EVERYTHING,
        ("let_all_in", "entry_place", "has_left", "clear_of_obstacles"),
    ),
    "inlet of beads": (dataclasses.replace(BASE, inlet=True), BASE, ("kept_in_domain", ").inlets)")),
    "inlet of beads, on a CPU": (
        dataclasses.replace(BASE, inlet=True, lanes=True),
        dataclasses.replace(BASE, lanes=True),
        ("kept_in_domain",),
    ),
    "inlet of bodies that turn": (
        dataclasses.replace(BASE, rigid=True, spheres=False, inlet=True),
        dataclasses.replace(BASE, rigid=True, spheres=False),
        ("kept_in_domain",),
    ),
    "grid inlet": (
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30, inlet=True),
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30),
        ("let_in_world", "has_left", ").outside)"),
    ),
    "grid inlet, soft contacts": (
        dataclasses.replace(SOFT_CROWD, inlet=True),
        SOFT_CROWD,
        ("let_slots_in", "has_left", ").outside)"),
    ),
    "pairs": (EVERYTHING, dataclasses.replace(EVERYTHING, pairs=False), ("pair_contacts",)),
    "worlds that end": (
        dataclasses.replace(BASE, episodes=True),
        BASE,
        ("living_world", "own_step", "trial_number"),
    ),
    "worlds that end, in contact": (
        dataclasses.replace(EVERYTHING, episodes=True),
        EVERYTHING,
        ("living_world", "own_step", "trial_number"),
    ),
    "worlds that end, on a CPU": (
        dataclasses.replace(BASE, episodes=True, lanes=True),
        dataclasses.replace(BASE, lanes=True),
        ("living_world", "own_step", "trial_number"),
    ),
    "grid pairs": (
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30),
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30, pairs=False),
        ("cell_key", "sphere_contacts"),
    ),
    "grid moving obstacles": (
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30),
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30, moving_traps=False, moving_obstacles=False),
        ("moving_pose", "find_key"),
    ),
    "grid rotation": (
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30),
        dataclasses.replace(EVERYTHING, driver="grid", bodies=30, rigid=False),
        ("rigid_response", "rigid_constants", "rotate_by"),
    ),
}


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
    """A free sphere without noise: of all functions of the cases above only its own move is left."""
    least = source(dataclasses.replace(BASE, brownian=False))
    assert [n for _, _, names in CASES.values() for n in names if n in least] == ["bead_constants"]


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
