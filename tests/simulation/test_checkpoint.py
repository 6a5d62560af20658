"""Checkpoints: 1000 steps are 400, a file, a new process and 600 more, bit for bit; other files are refused."""

from __future__ import annotations

import dataclasses
import inspect
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import warp as wp

import otwarp as ot
from otwarp.errors import InputError
from otwarp.scene import Scene, SceneBuilder
from otwarp.scene.digest import scene_digest
from otwarp.simulation.options import StepOptions
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import bead_scene
from tests.simulation.test_determinism import touching_scene

OLD = Path(__file__).parent / "data" / "bead_before_forces.npz"
"""A checkpoint of format 1 from before bodies could have forces; its scene lies beside it."""

CONTINUE = """
import sys
import numpy as np
import otwarp.simulation.composition as composition
from otwarp.simulation.simulation import Simulation
checkpoint, out, limit, device = sys.argv[1:]
composition.MAX_WORLD_BODIES = int(limit)
sim = Simulation.restore(checkpoint, device=device)
assert sim.state.step == 400, sim.state.step
sim.step(600)
r = sim.readout
np.savez(out, position=sim.state.position.numpy(), load=r.contact_load.numpy(), escape=r.escape_step.numpy(),
         force=r.trap_force.numpy(), step=sim.state.step, time=sim.time, power=sim.control.trap_power.numpy())
"""


def authored(scene: Scene, path: Path) -> Scene:
    """Write a scene as a stage and read it back."""
    builder = SceneBuilder(root=scene.root, medium=scene.medium, settings=scene.settings)
    for item in (*scene.traps, *scene.bodies, *scene.obstacles, *([scene.flow] if scene.flow else [])):
        builder.add(item)
    builder.save(path)
    return Scene.load(path)


@pytest.mark.thorough
@pytest.mark.parametrize("driver", ["world", "grid"])
def test_continues_bit_for_bit_in_a_new_process(driver, tmp_path, monkeypatch, device):
    limit = 0 if driver == "grid" else 24
    monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", limit)
    scene = authored(touching_scene(), tmp_path / "pair.usda")
    options = {"worlds": 3, "seed": 17, "device": device, "parameters": {"medium_viscosity": [8e-4, 9e-4, 1e-3]}}
    whole, first = Simulation(scene, **options), Simulation(scene, **options)
    for sim in (whole, first):
        assert sim.model.features.driver == driver
        # commands count as state: this one is not the scene's
        sim.control.trap_power.assign(np.array([[19.0, 21.0]], dtype=np.float32))
    whole.step(1000)
    first.step(400)
    checkpoint = first.save(tmp_path / "pair.npz")
    out = tmp_path / "out.npz"
    command = [sys.executable, "-c", CONTINUE, str(checkpoint), str(out), str(limit), device]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    got, readout = np.load(out), whole.readout
    assert int(got["step"]) == 1000
    assert float(got["time"]) == whole.time
    expected = {
        "position": whole.state.position, "load": readout.contact_load, "escape": readout.escape_step,
        "force": readout.trap_force, "power": whole.control.trap_power,
    }  # fmt: skip
    for name, value in expected.items():
        assert got[name].tobytes() == value.numpy().tobytes(), name
    assert np.any(got["load"] > 0)


@pytest.fixture
def saved(tmp_path, device) -> Path:
    scene = authored(bead_scene(), tmp_path / "bead.usda")
    sim = Simulation(scene, worlds=2, seed=3, device=device)
    sim.step(5)
    return sim.save(tmp_path / "bead.npz")


def check_refused(path: Path, match: str) -> None:
    with pytest.raises(InputError, match=match) as error:
        Simulation.restore(path, device="cpu")
    assert "\n" not in str(error.value)


def rewrite(path: Path, drop: tuple[str, ...] = (), about: dict | None = None, **arrays: np.ndarray) -> None:
    """The checkpoint with some arrays dropped or replaced, and some of what it says changed."""
    with np.load(path) as file:
        stored = {k: file[k] for k in file.files if k not in drop} | arrays
    if about is not None and "about" in stored:
        stored["about"] = np.array(json.dumps(json.loads(str(stored["about"])) | about))
    np.savez(path, **stored)


def test_good_checkpoint_restores(saved):
    sim = Simulation.restore(saved, device="cpu")
    assert sim.state.step == 5
    assert isinstance(sim.state.position, wp.array)
    assert not list(saved.parent.glob("*.tmp"))


@pytest.mark.parametrize("step", [-5, 1.5, "5", None])
def test_a_checkpoint_of_no_step_is_refused(step, saved):
    rewrite(saved, about={"step": step})
    check_refused(saved, f"not a readable otwarp checkpoint: its step is {step}, and must be a whole number, 0 or more")


def test_a_checkpoint_of_a_pose_that_is_none_is_refused(saved):
    with np.load(saved) as file:
        place = file["state.position"]
    rewrite(saved, **{"state.position": np.full_like(place, np.nan)})
    check_refused(saved, "its array state.position has numbers that are none")


def test_a_checkpoint_from_before_bodies_had_forces_goes_on(device):
    """In what steps of it are to the last bit processors differ, so that only where it starts is compared."""
    with np.load(OLD) as file:
        stored = dict(file)
    assert not any("body_force" in name for name in stored)
    sim = Simulation.restore(OLD, scene=Scene.load(OLD.with_suffix(".usda")), device=device)
    assert sim.state.step == json.loads(str(stored["about"]))["step"] == 5
    np.testing.assert_array_equal(sim.state.position.numpy(), stored["state.position"])
    sim.step(3)
    assert sim.state.step == 8
    moved = sim.state.position.numpy() - stored["state.position"]
    assert np.all(np.isfinite(moved))
    assert np.any(moved != 0)


def test_forces_of_a_scene_count_where_it_has_some():
    """Without any a scene is the one that older checkpoints know."""
    scene = Scene.load(OLD.with_suffix(".usda"))
    (bead,) = scene.bodies
    pushed = dataclasses.replace(scene, bodies=(dataclasses.replace(bead, forces={"external_force": (1.0, 0.0, 0.0)}),))
    with np.load(OLD) as file:
        assert scene_digest(scene) == json.loads(str(file["about"]))["digest"] != scene_digest(pushed)


@ot.force(strength="pN", slope=0.0, load=5.0)
def steady(body: ot.ForceInput, strength: float):
    return wp.vec3(strength, 0.0, 0.0)


CHOICES = (
    {
        "time_step": 2e-5, "integrator": "leimkuhlerMatthews", "noise": "threePoint", "crossings": False,
        "fast_math": True, "forces": (steady(strength=2.0),), "ends": (ot.timed_out(after=3.0),), "glides": True,
    },
    {"precision": "float64"},
)  # fmt: skip


@pytest.mark.parametrize(
    "chosen",
    [pytest.param(CHOICES[0], id="float32"), pytest.param(CHOICES[1], id="float64", marks=pytest.mark.thorough)],
)
def test_every_option_of_the_step_is_kept(chosen, tmp_path, device):
    """The largest step that is allowed is not: one that was accepted is accepted again."""
    names = {f.name for f in dataclasses.fields(StepOptions)}
    assert {name for choice in CHOICES for name in choice} | {"allow_large_step"} == names
    scene = authored(bead_scene(), tmp_path / "bead.usda")
    sim = Simulation(scene, device=device, **chosen)
    path = sim.save(tmp_path / "bead.npz")
    own = {"forces": (steady,)} if "forces" in chosen else {}
    back = Simulation.restore(path, device=device, **own).options
    for name in names - {"forces", "ends", "allow_large_step"}:
        assert getattr(back, name) == getattr(sim.options, name), name
        if name in chosen:
            assert getattr(back, name) == chosen[name] != getattr(StepOptions(), name), name
    assert [f.body_force for f in back.forces] == [f.body_force for f in sim.options.forces]
    assert [e.predicate for e in back.ends or ()] == [e.predicate for e in sim.options.ends or ()]


def test_options_of_the_step_are_arguments_of_a_simulation():
    arguments = inspect.signature(Simulation).parameters
    assert {n: arguments[n].default for n in vars(StepOptions())} == vars(StepOptions())


@pytest.mark.parametrize("cut", [0, 10, 0.5, 0.98])
def test_truncated_files(saved, cut):
    whole = saved.read_bytes()
    saved.write_bytes(whole[: int(cut if cut >= 1 else cut * len(whole))])
    check_refused(saved, "is not a readable otwarp checkpoint")


def test_flipped_bits(saved):
    whole = bytearray(saved.read_bytes())
    at = whole.index(b"state.position.npy") + 160
    whole[at] ^= 0xFF
    saved.write_bytes(bytes(whole))
    check_refused(saved, "is not a readable otwarp checkpoint")


def test_foreign_files(tmp_path, saved):
    text = tmp_path / "notes.npz"
    text.write_text("not an archive")
    check_refused(text, "is not a readable otwarp checkpoint")
    np.save(tmp_path / "plain.npy", np.ones(3))
    check_refused(tmp_path / "plain.npy", "is not a readable otwarp checkpoint")
    np.savez(tmp_path / "other.npz", a=np.ones(3))
    check_refused(tmp_path / "other.npz", "is not a readable otwarp checkpoint.*about")
    np.savez(tmp_path / "listed.npz", about=np.array("[1, 2]"))
    check_refused(tmp_path / "listed.npz", "is not a readable otwarp checkpoint")
    check_refused(tmp_path / "absent.npz", "No such file")
    check_refused(tmp_path, "cannot be read")


def test_incomplete_checkpoints(saved):
    rewrite(saved, about={"format": 99})
    check_refused(saved, "has checkpoint format 99; allowed: 1")
    rewrite(saved, about={"format": 1}, **{"state.position": np.zeros((5, 1, 3), dtype=np.float32)})
    check_refused(saved, r"state\.position is missing or misshapen")
    rewrite(saved, drop=("state.position",))
    check_refused(saved, r"state\.position is missing or misshapen")


def test_changed_scenes(saved):
    stage = saved.with_suffix(".usda")
    text = stage.read_text()
    assert "ot:trap:power = 0.02" in text
    stage.write_text(text.replace("ot:trap:power = 0.02", "ot:trap:power = 0.021"))
    check_refused(saved, r"bead\.usda (differs|has changed)")
    stage.unlink()
    check_refused(saved, r"bead\.usda")


def test_only_scenes_from_files_can_be_saved(tmp_path, device):
    with pytest.raises(InputError, match="was not loaded from one"):
        Simulation(bead_scene(), device=device).save(tmp_path / "x.npz")


def test_unwritable_places(saved, device):
    sim = Simulation.restore(saved, device=device)
    with pytest.raises(InputError, match=r"checkpoint .* cannot be written: "):
        sim.save(saved.parent / "nowhere" / "x.npz")
