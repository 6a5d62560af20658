"""Studies end to end: the same bits however they are computed, against the survival of a well."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from otwarp.bench.integrators.fokker_planck import survival_probability
from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.laws import TrapLaw
from otwarp.scene import Body, SceneBuilder, Settings, Sphere, Track, Trap
from otwarp.simulation.simulation import Simulation
from otwarp.studies.axes import Scatter, values
from otwarp.studies.engines.run import run_study
from otwarp.studies.observables import contact_dose, contact_force, delivered, first_passage, orientation_error, trapped
from otwarp.studies.results import table
from otwarp.studies.stopping.rules import half_width, trials
from otwarp.studies.store import open_store
from otwarp.studies.study import Study
from otwarp.units import BOLTZMANN
from tests.studies.scenes import bead_in_a_well, study_of, study_of_a_well

pytest.importorskip("zarr")

ROOT = Path(__file__).parents[2]

FILE = study_of_a_well(6, 2_048)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return bead_in_a_well(tmp_path_factory.mktemp("well"))


def same(a, b):
    return all(np.array_equal(a[n], b[n], equal_nan=a[n].dtype.kind == "f") for n in a) and a.keys() == b.keys()


def test_results_do_not_depend_on_batches(scene):
    """Blocks one by one, together, and in batches of 17 trials: the same bits."""
    study = study_of(scene)
    together = study.compute([0], device="cpu")[0]
    assert same(together, study.compute([0], device="cpu", worlds=17, threads=1)[0])
    assert together["trials"].tolist() == [[64, 64]] * 3
    assert np.all(together["end"] >= 0) and np.any(together["end"] == 1)


@pytest.mark.thorough
def test_what_a_trap_holds_does_not_depend_on_batches(tmp_path):
    """A trap that names no sphere, moved from one to another: it holds one sphere in all points, in whatever batch."""
    builder = SceneBuilder(settings=Settings(duration=0.5, accuracy=0.05))
    for n, x in enumerate((-1.0, 1.0)):
        sphere = Sphere(prim=f"/World/bead{n}/sphere", radius=0.5, refractive_index=1.59)
        builder.add(Body(prim=f"/World/bead{n}", position=(x, 0.0, 10.0), spheres=(sphere,)))
    law = TrapLaw(stiffness=0.5, threshold=0.6, cutoff=0.6, power=1.0)
    place = Track.constant((-1.0, 0.0, 10.0))
    builder.add(Trap(prim="/World/trap", position=place, power=Track.constant(1.0), radial=law))
    axes = {"trap_position.x:/World/trap": values([-1.0, 0.9], unit="µm")}
    study = study_of(builder.save(tmp_path / "two.usda"), axes=axes, observables=[trapped(until=0.02)], stop=trials(8))
    together = study.compute([0], device="cpu")[0]
    assert same(together, study.compute([0], device="cpu", worlds=8)[0])
    assert together["end"][0].tolist() != together["end"][1].tolist()


def test_a_look_brings_two_numbers_to_the_host(scene, monkeypatch):
    """However many trials there are: what waits for a GPU between the segments is not a number of each world."""
    study = study_of(scene, axes={"trap_power": values([1.0], unit="mW")}, stop=trials(512))
    study.compute([0], device="cpu")
    brought: list[list[int]] = []
    numpy, step = wp.array.numpy, Simulation.step
    monkeypatch.setattr(Simulation, "step", lambda sim, n, **how: brought.append([]) or step(sim, n, **how))
    monkeypatch.setattr(wp.array, "numpy", lambda a: (brought and brought[-1].append(a.size)) or numpy(a))
    study.compute([0], device="cpu")
    assert len(brought) > 15
    assert all(sum(sizes) <= 4 for sizes in brought[:-1])  # twice two: a CPU also asks how many it lists
    assert sum(brought[-1]) >= 2 * 512  # at last what became of each


def test_outcomes_do_not_depend_on_looks(scene):
    """Where escapes alone end trials there are fewer looks, early ones the closest; `every` says how many there are."""
    power = {"trap_power": values([0.05, 0.3], unit="mW")}
    study, fixed = (study_of(scene, axes=power, stop=trials(128), every=every) for every in (None, 0.002))
    looks, even = list(study.runner.segments()), list(fixed.runner.segments())
    assert sum(looks) == sum(even) == study.runner.steps
    assert len(looks) < 30 and looks[0] <= study.runner.steps / 100 + 1
    assert max(looks) <= study.runner.steps / 16 + 1 and len(set(even[:-1])) == 1
    found, beside = (s.compute([0], device="cpu")[0] for s in (study, fixed))
    assert same(found, beside)
    assert {0, 1} <= set(found["end"].ravel().tolist())
    ends = study_of(scene, observables=[delivered((0.2, 0.0, 10.0), radius=0.1, until=0.1)])
    assert set(ends.runner.segments()) == {ends.runner.every}, "what is known at looks alone"


def test_trials_are_those_of_one_simulation(scene):
    """Points that share their rows and starts on the device, in batches of 100: a row, a start and a number for each
    world of a `Simulation` give the same bits, and so does what NumPy makes of its arrays."""
    study = study_of(scene, observables=[first_passage(), delivered((0.2, 0.0, 10.0), radius=0.1, until=0.1)])
    found = study.compute([0], device="cpu", worlds=100)[0]
    runner, points = study.runner, np.repeat(np.arange(6), 64)
    powers, starts = np.linspace(0.2, 1.0, 3)[points // 2], 0.2 * (points % 2)
    sim = Simulation(study.design.scene, worlds=384, seed=3, device="cpu", parameters={"trap_power": powers[:, None]},
                     ends=study.ends, time_step=runner.time_step, allow_large_step=True)  # fmt: skip
    place = np.stack([starts, np.zeros(384), np.full(384, 10.0)], axis=1)
    sim.reset(position=place[:, None], number=np.arange(384))
    while sim.state.step < runner.steps:
        sim.step(min(runner.every, runner.steps - sim.state.step))
    lost = sim.last_readout.escape_step.numpy()[:, 0]
    code = np.where(lost >= 0, 1, sim.episodes.done.numpy())
    when = np.where(lost >= 0, lost, sim.episodes.step.numpy()) * runner.time_step
    assert {0, 1, 2} == set(code.tolist())
    assert np.array_equal(found["end"].ravel(), code)
    assert np.array_equal(found["end_time"].ravel(), when.astype(np.float32))


def test_more_trials_keep_the_first_ones(scene):
    """A study with a rule runs the first trials of one with a number, bit for bit, and stops where it is narrow."""
    most = study_of(scene, stop=half_width(0.08, at_least=16, at_most=512)).compute([0], device="cpu")[0]
    low = most["trials"]
    assert low.min() < 200 and low.max() <= 512
    again = study_of(scene, stop=half_width(0.06, at_least=16, at_most=512)).compute([0], device="cpu")[0]
    assert np.all(again["trials"] >= low)
    first = np.arange(512) < low[..., None]
    assert np.array_equal(most["end_time"][first], again["end_time"][first])


KILLED = """
import os, signal
from otwarp.studies.store import Store

mark = Store.mark

def killed(store, block):
    if store.finished():
        os.kill(os.getpid(), signal.SIGKILL)
    mark(store, block)

Store.mark = killed
from otwarp.cli.start import start
start()
"""
"""The command, killed when the second block is written and not yet marked as whole."""


def test_a_killed_study_goes_on(tmp_path, scene):
    """SIGKILL in mid-work, then the same line: bit for bit what an undisturbed run and three shards give."""
    (tmp_path / "well.usda").write_text(scene.read_text())
    (tmp_path / "s.toml").write_text(FILE)
    command = [sys.executable, "-m", "otwarp", "study", "run", str(tmp_path / "s.toml"), "--device", "cpu", "-o"]
    out = tmp_path / "killed"
    line = [command[0], "-c", KILLED, *command[3:], str(out)]
    ended = subprocess.run(line, capture_output=True, text=True, check=False)
    assert ended.returncode == -signal.SIGKILL, ended.stderr
    assert len(open_store(out).finished()) == 1
    assert main([*command[3:], str(out)]) == 0
    shards = tmp_path / "shards"
    for n in (3, 1, 2):
        assert main([*command[3:], str(shards), "--shard", f"{n}/3"]) == 0
    a, b = (open_store(folder).read().load() for folder in (out, shards))
    assert a.identical(b) and np.all(a["trials"] == 2048)
    assert main(["study", "status", str(out)]) == 0
    assert main(["study", "export", str(out), "-o", str(tmp_path / "out.nc")]) == 0
    assert main(["study", "show", str(out), "--plot", str(tmp_path / "map.png")]) == 0
    assert (tmp_path / "map.png").stat().st_size > 10_000


def test_another_study_is_refused(tmp_path, scene, capsys):
    """A folder goes on with its own study alone; the message says what differs."""
    run_study(study_of(scene, stop=trials(4)), tmp_path / "out", devices=["cpu"])
    for how, what in (
        ({"seed": 4}, "seed"),
        ({"stop": trials(5)}, "stop"),
        ({"observables": [first_passage()]}, "obs"),
    ):
        with pytest.raises(InputError, match=f"another {what}"):
            run_study(study_of(scene, **({"stop": trials(4)} | how)), tmp_path / "out", devices=["cpu"])
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "letter.txt").write_text("mine")
    with pytest.raises(InputError, match="holds other files"):
        run_study(study_of(scene), tmp_path / "full")
    said = json.loads((tmp_path / "out" / "study.json").read_text())
    (tmp_path / "out" / "study.json").write_text(json.dumps(said | {"version": 99}))
    with pytest.raises(InputError, match="version = 99"):
        open_store(tmp_path / "out")


def test_two_drivers_are_refused(tmp_path, scene):
    """One process at a time where there is something to do, but for shards."""
    study = study_of(scene, stop=trials(4))
    store = run_study(study, tmp_path / "out", devices=["cpu"])
    marker = store.folder / "done" / "000000"
    with store.claimed():
        run_study(study, tmp_path / "out", devices=["cpu"])
        marker.unlink()
        with pytest.raises(InputError, match="another process runs this study"):
            run_study(study, tmp_path / "out", devices=["cpu"])
        run_study(study, tmp_path / "out", devices=["cpu"], shard=(1, 1))
    assert marker.exists()


def test_groups_and_scatter(tmp_path, scene):
    """Radii make models of their own; power that scatters is a parameter of each trial; numbers have errors."""
    study = Study(
        scene,
        axes={"/World/bead/sphere.radius": values([0.4, 0.6], unit="µm")},
        observables=[trapped(until=0.05)],
        scatter={"trap_power": Scatter(10.0)},
        stop=trials(32),
    )
    assert study.plan().groups == 2
    found = table(run_study(study, tmp_path / "out", devices=["cpu"]))
    assert found.sizes == {"sphere_radius": 2} and found["sphere_radius"].attrs["units"] == "µm"
    assert np.all(found["trapped_low"] <= found["trapped"])
    assert json.loads(found.attrs["scatter"]) == {"trap_power": {"deviation": 10.0, "unit": "%"}}
    assert json.loads(found.attrs["stop"])["at_most"] == 32
    again = study.compute([0], device="cpu", worlds=5)[0]
    assert np.array_equal(again["end"], open_store(tmp_path / "out").read()["end"].values)


def test_capture_against_the_backward_fokker_planck_equation(scene):
    """P(start, power) to be held for 0.1 s, 2,048 trials each, within 5 standard errors and a step's 1 %."""
    fine = bead_in_a_well(scene.parent, accuracy=0.005)
    study = study_of(fine, stop=trials(2_048), observables=[trapped(until=0.1)])
    sim = study.design.scene
    found = study.compute([0], device="cpu")[0]
    held = np.mean(found["end"] == 0, axis=-1)
    energy = BOLTZMANN * sim.medium.temperature
    diffusion = energy / (6.0 * np.pi * sim.medium.viscosity * 0.5)
    for row, power in zip(held, (0.2, 0.6, 1.0), strict=True):
        right = survival_probability(
            lambda place, k=0.5 * power: -k * place,
            0.4,
            np.array([0.001, 0.2]),
            0.1,
            diffusion=diffusion,
            energy=energy,
        )
        for p, wanted in zip(row, right, strict=True):
            error = np.sqrt(wanted.value * (1.0 - wanted.value) / 2_048)
            assert abs(p - wanted.value) <= 5.0 * error + 0.01 * (1.0 - wanted.value) + wanted.error


def test_escape_rate_of_a_deep_well(tmp_path, scene):
    """Rates grow with shallower wells, and intervals of a rate that was never seen have an upper end alone."""
    found = table(run_study(study_of(scene, stop=trials(256)), tmp_path / "out", devices=["cpu"]))
    rates = found["first_passage_rate"].values[:, 0]
    assert np.all(np.diff(rates) < 0.0)
    assert np.all(found["first_passage_rate_high"] > found["first_passage_rate"])
    assert np.all(found["first_passage_rate_low"].values[found["first_passage_events"] == 0] == 0.0)
    kept = found["trapped_count"].values + found["first_passage_events"].values
    assert np.all(kept >= 256)  # who escaped later than 0.1 s counts for both


def test_contact_force_is_an_observable(scene):
    """A name that needs no arguments may stand there as it is."""
    assert study_of(scene, observables=[trapped(until=0.1), contact_force]).observables[1].name == "contact_force"


def test_numbers_of_a_body(scene):
    """Nothing can touch a lone bead: no force. A body that is not there, or does not turn, is refused."""
    study = study_of(scene, axes={}, observables=[trapped(until=0.002), contact_force], stop=trials(4))
    assert study.compute([0], device="cpu")[0]["contact_force_of_trial"].tolist() == [0.0] * 4
    for asked, said in (
        (contact_force(body=1), "contact_force has body = 1; allowed: 0 … 0"),
        (contact_force(body=-1), "body = -1"),
        (contact_dose(body=0.5), "contact_dose has body = 0.5"),
        (orientation_error(x=1.0, w=0.0), "/World/bead is one sphere, which has no orientation"),
    ):
        with pytest.raises(InputError, match=said):
            study_of(scene, observables=[asked])


def test_a_shipped_scene_is_found_by_its_name():
    study = Study("table_trap", observables=[trapped(until=0.01)], stop=trials(8))
    assert study.design.scene.file == ROOT / "scenes" / "table_trap.usda"
