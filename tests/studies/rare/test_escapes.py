"""Studies of escapes end to end: against the exact time, the same bits however they are computed, and bad input."""

from __future__ import annotations

import os
import signal
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import otwarp as ot
from otwarp.bench.integrators.fokker_planck import mean_exit_time
from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.studies.engines.local import on_this_host
from otwarp.studies.engines.run import run_study
from otwarp.studies.file import load_study
from otwarp.studies.rare import basin
from otwarp.studies.rare.ensemble import Ensemble
from otwarp.studies.rare.orders import distance
from otwarp.studies.rare.placement import MOST
from otwarp.studies.rare.results import interval_of_mean
from otwarp.studies.rare.study import EscapeStudy
from otwarp.studies.store import open_store
from otwarp.units import BOLTZMANN
from tests.reference.fokker_planck import mean_first_passage
from tests.studies.scenes import bead_in_a_well, energy, pair_in_wells

pytest.importorskip("zarr")

STIFFNESS, RIM, DRAG = 0.5, 0.4, 6.0 * np.pi * 0.00089 * 0.5
SMALL: dict[str, Any] = {"runs": 4, "branches": 64, "seed": 3}

FILE = """
scene = "well.usda"
seed = 3
[[axis]]
name = "trap_power"
values = [0.5, 0.8]
unit = "mW"
[escape]
order = "distance"
runs = 3
branches = 64
relax = "0.1 s"
halved = false
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return bead_in_a_well(tmp_path_factory.mktemp("well"))


def power_of(depth: float) -> float:
    """Power [mW] of a well of so many k_BT."""
    return 2.0 * depth * BOLTZMANN * 298.15 / RIM**2 / STIFFNESS


def exact(depth: float) -> float:
    """Mean time from the centre to the rim [s]."""
    k, thermal = STIFFNESS * power_of(depth), BOLTZMANN * 298.15
    return mean_first_passage(lambda r: 0.5 * k * r**2, RIM, diffusion=thermal / DRAG, energy=thermal)


def check(study: EscapeStudy, depth: float, *, step: float, most: float, name: str = "rate") -> None:
    """Mean of the runs within 5 standard errors and what the step leaves."""
    found = study.compute([0], device="cpu")[0]
    rates = found[f"{name}_of_trial"].ravel()
    ratio = rates.mean() * exact(depth)
    error = rates.std(ddof=1) / rates.mean() / np.sqrt(len(rates))
    assert error < most, f"{depth} k_BT: standard error {error:.3f}"
    assert abs(ratio - 1.0) < 5.0 * error + step, f"{depth} k_BT: rate over exact {ratio:.3f} ± {error:.3f}"


def at(scene, depth: float, **how) -> EscapeStudy:
    """A study of one well, at a step of 0.02 γ/k."""
    relaxation = DRAG / (STIFFNESS * power_of(depth))
    asked: dict[str, Any] = {"time_step": 0.02 * relaxation, "halved": False, "seed": 11, "runs": 8, "branches": 300}
    return EscapeStudy(scene, axes={"trap_power": ot.values([power_of(depth)], unit="mW")}, **(asked | how))


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("depth", "how"),
    [
        (8.0, {"interfaces": [0.21, 0.3, 0.31, 0.398], "basin": 0.2}),
        pytest.param(
            6.0, {"order": ot.energy(), "interfaces": [1.6, 4.0, 5.9], "basin": 1.5}, marks=pytest.mark.thorough
        ),
        pytest.param(5.0, {"method": "splitting", "branches": 100}, marks=pytest.mark.thorough),
    ],
)
def test_against_the_exact_time(scene, depth, how):
    """Both methods, and both order parameters; interfaces of one's own, the last a hair's breadth from the rim."""
    check(at(scene, depth, **how), depth, step=0.03, most=0.15)


@pytest.mark.validate
@pytest.mark.parametrize(
    ("depth", "how", "most"),
    [
        (20.0, {"method": "splitting"}, 0.03),
        (20.0, {"crossing": 0.5}, 0.02),
        (20.0, {"order": energy, "every": 1}, 0.02),
        (20.0, {"order": ot.energy()}, 0.02),
        (8.0, {"order": ot.energy(), "method": "splitting"}, 0.02),
    ],
)
def test_precisely_against_the_exact_time(scene, depth, how, most):
    """Other methods, orders and crossings, at 0.01 γ/k: within 5 standard errors, each less than `most`, and 1 %.

    `tests/validation/test_escapes.py` has those of the usual choice, from 5 to 30 k_BT, interfaces of one's own, and
    traps that are dragged and tabulated.

    Source: the double integral of Gardiner 2009, Stochastic Methods, section 5.5.
    """
    relaxation = DRAG / (STIFFNESS * power_of(depth))
    study = at(scene, depth, **({"runs": 32, "branches": 4000, "time_step": 0.01 * relaxation} | how))
    check(study, depth, step=0.01, most=most)


def waited_for(scene: Path, study: EscapeStudy, power: float, *, worlds: int) -> tuple[float, float]:
    """Rate of first passages [1/s] of worlds that all run until they have escaped, and its relative standard error."""
    sim = ot.Simulation(
        ot.Scene.load(scene), worlds=worlds, seed=12, device="cpu", ends=[ot.escaped],
        time_step=study.horizon / int(study.step_counts[0]), parameters={"trap_power": power},
        allow_large_step=True,
    )  # fmt: skip
    while sim.episodes.running:
        sim.step(500)
    steps = sim.readout.escape_step.numpy()
    times = (np.where(steps < 0, np.inf, steps).min(axis=1) - 0.5) * sim.time_step
    return 1.0 / times.mean(), times.std(ddof=1) / times.mean() / np.sqrt(len(times))


@pytest.mark.validate
@pytest.mark.parametrize("depth", [5.0, 6.5, 8.0])
def test_against_trajectories_that_wait_for_it(scene, depth):
    """First passages of worlds that all run until they have escaped: the same rate, within 5 standard errors."""
    study = at(scene, depth, runs=16, branches=2000)
    rates = study.compute([0], device="cpu")[0]["rate_of_trial"].ravel()
    direct, error = waited_for(scene, study, power_of(depth), worlds=4000)
    own = rates.std(ddof=1) / rates.mean() / np.sqrt(len(rates))
    assert error < 0.02 and own < 0.02
    assert abs(rates.mean() / direct - 1.0) < 5.0 * np.hypot(error, own)


@pytest.mark.validate
@pytest.mark.parametrize("order", [ot.distance(), ot.energy()], ids=lambda order: order.name)
def test_in_a_trap_that_is_softer_along_the_beam(tmp_path, order):
    """Curves of their own across and along the beam: the rim is 12 k_BT high across, and half as high along it."""
    depth = 12.0
    soft = bead_in_a_well(tmp_path, axial=0.5 * STIFFNESS)
    k = STIFFNESS * power_of(depth) * np.array([1.0, 1.0, 0.5])
    thermal = BOLTZMANN * 298.15
    exact = mean_exit_time(lambda r: -k * r, RIM, diffusion=thermal / DRAG, energy=thermal)
    found = at(soft, depth, runs=16, branches=1000, order=order).compute([0], device="cpu")[0]
    rates = found["rate_of_trial"].ravel()
    error = rates.std(ddof=1) / rates.mean() / np.sqrt(len(rates))
    assert error < 0.03
    assert abs(rates.mean() * exact.value - 1.0) < 5.0 * error + 0.02 + exact.error / exact.value


@pytest.mark.thorough
def test_a_time_to_relax_that_is_given_is_believed(tmp_path, monkeypatch):
    """Where the pilot never finds that the order parameter has settled the error names what then helps."""
    monkeypatch.setattr(basin, "KOLMOGOROV", 0.0)
    moving, how = bead_in_a_well(tmp_path, speed=2.0), {"runs": 2, "branches": 64}
    with pytest.raises(InputError, match=r"has not settled .*; allowed: relax="):
        at(moving, 8.0, **how).compute([0], device="cpu")
    found = at(moving, 8.0, relax=0.1, **how).compute([0], device="cpu")[0]
    assert np.all(found["rate_of_trial"] > 0.0)


@pytest.mark.thorough
def test_the_ratio_of_steps_tells_a_coarse_one(tmp_path, scene):
    """Of a well of 5 k_BT: 1 within 5 standard errors at 0.05 γ/k, and more than as many above it at 1 γ/k."""
    power = power_of(5.0)
    axes = {"trap_power": ot.values([power], unit="mW")}
    for step, good in ((0.05, True), (1.0, False)):
        time_step = step * DRAG / (STIFFNESS * power)
        study = EscapeStudy(scene, axes=axes, runs=8, branches=200, seed=11, time_step=time_step)
        found = study.run(tmp_path / f"{step:g}", devices=["cpu"])
        ratio, error = (float(found[name].item()) for name in ("step_ratio", "step_ratio_error"))
        away = (ratio - 1.0) / error
        assert error < 0.06
        assert abs(away) < 5.0 if good else away > 5.0, f"{step:g} γ/k: {ratio:.3f} ± {error:.3f}"


@pytest.mark.thorough
def test_a_robot_against_trajectories_that_wait_for_it(tmp_path):
    """A rigid body of two spheres, each in a well of 6 k_BT, until a trap has lost its own: the rate of 2,000 worlds
    that all run until then, within 5 standard errors of both."""
    file, power = pair_in_wells(tmp_path), power_of(6.0)
    study = at(file, 6.0, runs=16, branches=200, time_step=0.1 * DRAG / (STIFFNESS * power))
    rates = study.compute([0], device="cpu")[0]["rate_of_trial"].ravel()
    direct, error = waited_for(file, study, power, worlds=2000)
    own = rates.std(ddof=1) / rates.mean() / np.sqrt(len(rates))
    assert error < 0.03 and own < 0.05
    assert abs(rates.mean() / direct - 1.0) < 5.0 * np.hypot(error, own)


@pytest.mark.thorough
def test_results_do_not_depend_on_batches(scene):
    """Runs side by side and one by one, points together and alone: the same bits."""
    study = EscapeStudy(scene, axes={"trap_power": ot.values([0.5, 0.8], unit="mW")}, relax=0.1, **SMALL)
    together = study.compute([0, 1], device="cpu")
    alone = [study.compute([n], device="cpu", worlds=64, threads=1)[0] for n in (1, 0)][::-1]
    for a, b in zip(together, alone, strict=True):
        assert a.keys() == b.keys()
        assert all(np.array_equal(a[name], b[name], equal_nan=a[name].dtype.kind == "f") for name in a)
    assert np.all(together[0]["rate_of_trial"] > together[1]["rate_of_trial"])
    assert not np.array_equal(together[0]["rate_of_trial"], together[0]["rate_halved_of_trial"])


@pytest.mark.thorough
def test_from_a_file(tmp_path, scene, capsys):
    """plan, run in shards, run again, status, show, export; the store of shards is that of one driver."""
    (tmp_path / "well.usda").write_text(scene.read_text())
    file, out, shards = tmp_path / "s.toml", tmp_path / "out", tmp_path / "shards"
    file.write_text(FILE)
    assert isinstance(load_study(file), EscapeStudy)
    assert main(["study", "run", str(file), "-o", str(out), "--device", "cpu"]) == 0
    for n in (2, 1):
        assert main(["study", "run", str(file), "-o", str(shards), "--device", "cpu", "--shard", f"{n}/2"]) == 0
    a, b = (open_store(folder).read().load() for folder in (out, shards))
    assert a.identical(b) and np.all(a["trials"] == 3)
    capsys.readouterr()
    assert main(["study", "show", str(out)]) == 0
    assert "escape_time" in capsys.readouterr().out
    assert main(["study", "show", str(out), "--json"]) == 0
    assert '"interface_at"' in capsys.readouterr().out
    assert main(["study", "status", str(out)]) == 0
    assert main(["study", "show", str(out), "--plot", str(tmp_path / "e.png")]) == 0
    assert (tmp_path / "e.png").stat().st_size > 10_000
    assert main(["study", "export", str(out), "-o", str(tmp_path / "e.nc")]) == 0
    file.write_text(FILE.replace("branches = 64", "branches = 65"))
    assert main(["study", "run", str(file), "-o", str(out)]) == 2
    assert "another escape" in capsys.readouterr().err


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_an_interrupt_ends_a_block_in_its_middle(scene, tmp_path, monkeypatch):
    """As on GPUs, where a thread computes it: nothing is kept, no thread stays, the same bytes follow."""
    powers = ot.values([0.5], unit="mW")
    study = EscapeStudy(scene, axes={"trap_power": powers}, relax=0.1, halved=False, **(SMALL | {"runs": 2}))
    turn, heard, looks = Ensemble.turn, [], []

    def interrupted(self):
        if len(looks) == 100:
            os.kill(os.getpid(), signal.SIGINT)
            heard.append(self._unwanted.wait(60.0))
        turn(self)
        looks.append(threading.current_thread().name)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            patch.setattr(Ensemble, "turn", interrupted)
            run_study(study, tmp_path / "out", engine=on_this_host(["cpu", "cpu"]))
    finally:
        signal.signal(signal.SIGINT, before)
    assert heard == [True] and len(looks) == 100 and "study-device_0" in looks
    assert not [thread.name for thread in threading.enumerate() if thread.name.startswith("study-")]
    assert open_store(tmp_path / "out").finished() == []
    for name in ("out", "whole"):
        run_study(study, tmp_path / name, devices=["cpu"])
    assert bytes_in(tmp_path / "out") == bytes_in(tmp_path / "whole")


def bytes_in(folder: Path) -> dict[str, bytes]:
    """Of each file, by its place in the folder."""
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.mark.thorough
def test_an_escape_that_nobody_sees_has_a_bound(tmp_path, scene):
    """Paths that never come to the next interface: a rate of 0, and what it is at most."""
    study = EscapeStudy(
        scene, axes={"trap_power": ot.values([6.0], unit="mW")}, interfaces=[0.1, 0.39], halved=False, **SMALL
    )
    found = study.run(tmp_path / "out", devices=["cpu"])
    assert found["escape_rate"].item() == 0.0 == found["escape_rate_low"].item()
    assert np.isinf(found["escape_time"].item())
    flux = found["flux"].item()
    assert found["escape_rate_high"].item() == pytest.approx(flux * (1.0 - 0.05 ** (1.0 / 256)), rel=1e-6)


def test_intervals_hold_the_mean():
    """Student's interval of the logarithm, of runs that spread as those of deep wells do: 95 % within 5 errors."""
    random = np.random.default_rng(5)
    for spread, runs in ((0.1, 8), (0.4, 16)):
        values = random.lognormal(-0.5 * spread**2, spread, size=(4000, runs))
        low, high = interval_of_mean(values, np.ones_like(values, dtype=bool), 0.95)
        held = np.mean((low <= 1.0) & (high >= 1.0))
        assert held > 0.94 - 5.0 * np.sqrt(0.95 * 0.05 / 4000)


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ({"interfaces": [0.3, 0.2]}, "values that increase"),
        ({"interfaces": [0.2, np.nan]}, "values that increase"),
        ({"interfaces": []}, "1 to 64 finite"),
        ({"interfaces": [0.2], "basin": 0.3}, "beyond the first interface"),
        ({"interfaces": [0.2], "basin": True}, "basin is True; allowed: a finite distance"),
        ({"basin": "0.2"}, "basin is '0.2'; allowed: a finite distance"),
        ({"method": "fss"}, "allowed: forward-flux, splitting"),
        ({"runs": 1}, "runs is 1"),
        ({"branches": 1.5}, "branches is 1.5"),
        ({"crossing": 1.0}, "crossing is 1.0"),
        ({"relax": -1.0}, "relax is -1.0"),
        ({"order": "distance"}, "order is 'distance'"),
        ({"order": distance("/World/tarp")}, "did you mean /World/trap"),
        ({"runs": 4000}, "allowed: up to 2 such points"),
    ],
)
def test_bad_arguments(scene, how, said):
    """Name, value and what is allowed, before anything is simulated."""
    with pytest.raises(InputError, match=said):
        EscapeStudy(scene, axes={"trap_power": ot.grid(0.5, 1.0, 3, unit="mW")}, **(SMALL | {"branches": 64} | how))


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("how", "said"),
    [
        ({"interfaces": [0.395]}, "trap_power = 4.0 mW: the first interface, distance = 0.395, is hardly ever crossed"),
        ({"order": energy, "interfaces": [-1.0]}, "the scene starts at energy = .*, beyond the first interface"),
    ],
)
def test_what_only_paths_show(scene, how, said):
    """One line that names the point."""
    study = EscapeStudy(scene, axes={"trap_power": ot.values([4.0], unit="mW")}, halved=False, **(SMALL | how))
    with pytest.raises(InputError, match=said):
        study.compute([0], device="cpu")


def test_a_trap_too_deep_for_its_interfaces():
    """There are as many of them as the store keeps; what is beyond is not seen, and the rate has a bound."""
    scene = Path(__file__).parents[3] / "scenes" / "table_trap.usda"
    (found,) = EscapeStudy(scene, runs=2, branches=20, halved=False).compute([0], device="cpu")
    assert np.sum(np.isfinite(found["interface_at"])) == MOST and not np.any(found["rate_of_trial"])


def test_nothing_can_escape():
    """A trap without a rim holds for good."""
    scene = Path(__file__).parents[3] / "scenes" / "single_bead.usda"
    with pytest.raises(InputError, match=r"single_bead\.usda: end escaped: no trap with a finite reach holds a sphere"):
        EscapeStudy(scene, **SMALL).compute([0], device="cpu")


def test_a_force_without_a_potential():
    """No energy in a tabulated trap, found out before anything is simulated."""
    scene = Path(__file__).parents[3] / "scenes" / "table_trap.usda"
    with pytest.raises(InputError, match=r"order energy: the force of /World/\w*.* table, is not conservative"):
        EscapeStudy(scene, order=ot.energy(), **SMALL)


def test_bad_files(tmp_path, scene, capsys):
    """One line, exit code 2, and nothing is written."""
    (tmp_path / "well.usda").write_text(scene.read_text())
    for old, new, said in (
        ("branches = 64", "branch = 64", "escape has branch"),
        ('"distance"', '"energie"', "order is 'energie'; allowed: distance, energy"),
        ('"distance"', '{ name = "energy", relative = true }', "order is {'name'"),
        ('"distance"', '"energy"\ninterfaces = ["2 mW"]', "interface 1 has the unit 'mW'; allowed: k_BT"),
        ('"0.1 s"', '"0.1 µm"', "relax has the unit 'µm'"),
        ("[escape]", '[[observable]]\nkind = "first_passage"\n[escape]', "observable stands beside escape"),
        ("runs = 3", "interfaces = [0.2]", "interface 1 is 0.2 without a unit"),
    ):
        (tmp_path / "bad.toml").write_text(FILE.replace(old, new))
        assert main(["study", "run", str(tmp_path / "bad.toml"), "-o", str(tmp_path / "out")]) == 2
        assert said in (error := capsys.readouterr().err) and error.count("\n") == 1
        assert not (tmp_path / "out").exists()
