"""Speed beside other programs: tiny worlds, real measurements, no claim about speed."""

from __future__ import annotations

import json
import math
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from benchmarks.speed import BEAD_PEERS, MANY_BODY_PEERS
from otwarp.bench.report import NOTHING
from otwarp.bench.speed.figure import draw_speed
from otwarp.bench.speed.many_body import RADIUS, ManySpheres, spheres
from otwarp.bench.speed.measure import TimedWorkload, bench_speed
from otwarp.bench.speed.peers import c_bead
from otwarp.bench.speed.result import SpeedBench, SpeedRow
from otwarp.bench.speed.table import HEAD, caption, table
from otwarp.bench.speed.workloads import (
    CASES,
    LISTED,
    PARTICLES,
    RELAXATION,
    Prepared,
    Setting,
    Workload,
    case_a,
    table_robot,
    workloads,
)
from otwarp.bench.timing import Quartiles
from otwarp.cli.main import main
from otwarp.device import pick_device
from otwarp.errors import InputError
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions

BEADS = 512
CHANCE = 5.0 * math.sqrt(2.0 / (3 * BEADS))
"""5 standard errors of a variance from one snapshot of `BEADS` × 3 components."""


def kind_of(device: str) -> str:
    return "cpu" if pick_device(device).is_cpu else "cuda"


@pytest.fixture(scope="module")
def found(device) -> SpeedBench:
    said: list[str] = []
    scale = BEADS / PARTICLES[kind_of(device)]
    how = {"rounds": 2, "seconds": 1e-3, "scale": scale, "bead_peers": BEAD_PEERS}
    out = bench_speed(cases=["bead"], device=device, note=said.append, **how)
    assert {"bead in a spring, eulerMaruyama: building", "bead in a spring, heun: measuring"} <= set(said)
    return out


def test_rates_are_positive_and_ratios_are_to_the_first_row(found):
    first = found.rows[0]
    assert first.label == "bead in a spring, eulerMaruyama" and first.ratio is None and first.worlds == BEADS
    for row in found.rows:
        if row.rate is None:
            assert row.skipped and row.ratio is None and row.peer
            continue
        assert 0.0 < row.rate.low <= row.rate.median <= row.rate.high and row.worlds == BEADS
        assert (row.ratio is None) == (row is first)
        assert row.peer == (not row.label.startswith("bead in"))
    with pytest.raises(KeyError):
        found.row("absent")


def test_every_code_of_a_case_does_the_work(found):
    checked = [row for row in found.rows if row.check is not None]
    assert len(checked) >= 2 and any(row.peer for row in checked)
    for row in checked:
        assert row.check == pytest.approx(1.0, abs=CHANCE), row.label


@pytest.mark.parametrize("peer", BEAD_PEERS, ids=lambda peer: peer.label)
def test_a_peer_runs_or_says_why_not(peer, device):
    code, kind = peer.code, kind_of(device)
    other = "cuda" if kind == "cpu" else "cpu"
    reason = code.missing(kind)
    if reason is not None:
        assert "installed" in reason or "runs on" in reason or "CUDA" in reason
        return
    peer = code.Peer(BEADS, relaxation=RELAXATION, kick=0.05, seed=11, kind=kind)
    peer.step(1)
    peer.step(199)
    exact = 0.05**2 / (1.0 - (1.0 - RELAXATION) ** 2)
    assert peer.variance() == pytest.approx(exact, rel=CHANCE) and peer.name
    assert isinstance(code.missing(other), str | None)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_the_compiled_peer_draws_what_its_polynomials_should():
    # a step without a past: position − centre is the noise of that step
    peer = c_bead.Peer(200_000, relaxation=1.0, kick=1.0, seed=3)
    peer.step(1)
    x = (peer.position - peer.centre[:, None]).astype(float).ravel()
    n = len(x)
    # 5 standard errors of the moments of a normal distribution
    assert abs(x.mean()) < 5.0 / math.sqrt(n)
    assert abs(x.var() - 1.0) < 5.0 * math.sqrt(2.0 / n)
    assert abs(np.mean(x**4) - 3.0) < 5.0 * math.sqrt(96.0 / n)
    first = peer.position.copy()
    peer.step(1)
    assert abs(np.corrcoef(first.ravel() - np.repeat(peer.centre, 200_000), x)[0, 1] - 1.0) < 1e-6
    later = (peer.position - peer.centre[:, None]).ravel()
    assert abs(np.corrcoef(later, x)[0, 1]) < 5.0 / math.sqrt(n)
    assert sys.float_info.min * 0.5 > 0.0, "the library made this process flush subnormal numbers to zero"


CROWD, CROWD_STEPS = 4000, 300


def touching(places: np.ndarray) -> np.ndarray:
    """Distances of pairs that touch."""
    place = places.astype(float)
    near = cKDTree(place).query_pairs(2.0 * RADIUS, output_type="ndarray")
    return np.linalg.norm(place[near[:, 0]] - place[near[:, 1]], axis=1)


@pytest.fixture(scope="module")
def own_crowd() -> tuple[np.ndarray, np.ndarray]:
    """Places of otwarp's crowd at the start and the end."""
    crowd = ManySpheres(CROWD, pick_device("cpu"))
    start = crowd.state.position.numpy()[0].copy()
    crowd.step(CROWD_STEPS)
    return start, crowd.state.position.numpy()[0]


@pytest.mark.parametrize("code", [peer.code for peer in MANY_BODY_PEERS], ids=[peer.label for peer in MANY_BODY_PEERS])
def test_a_crowd_of_a_peer_pushes_apart_what_touches(code, own_crowd):
    """As many pairs touch, with as much energy, as in otwarp's own crowd."""
    if reason := code.missing("cpu"):
        pytest.skip(reason)
    peer, what = code.Peer(CROWD, seed=5), spheres(CROWD)
    start, end = own_crowd
    assert np.allclose(peer.positions(), start, atol=1e-5)
    peer.step(100)
    peer.step(CROWD_STEPS - 100)
    own, theirs = touching(end), touching(peer.positions())
    assert theirs.min() > 1.0 and len(theirs) > 100
    # counts of rare pairs are nearly Poissonian: 5 standard errors and 3 %
    assert abs(len(theirs) - len(own)) < 5.0 * math.sqrt(len(theirs) + len(own)) + 0.03 * len(own)
    energies = [what.energy(d) / what.thermal for d in (theirs, own)]
    chance = math.sqrt(sum(np.sum(e**2) for e in energies))
    assert abs(energies[0].sum() - energies[1].sum()) < 5.0 * chance + 0.03 * energies[1].sum()
    # at most as far as free spheres, 2 D t along each axis, and at this density not much less
    moved = peer.positions().astype(float) - start
    free = what.kick**2 * CROWD_STEPS
    assert 0.6 * free < moved.var(axis=0).mean() < 1.1 * free
    assert getattr(peer, "made", 11) > 10, "lists were not made anew"
    assert peer.name and isinstance(code.missing("cuda"), str | None)


@pytest.mark.parametrize("code", [peer.code for peer in MANY_BODY_PEERS], ids=[peer.label for peer in MANY_BODY_PEERS])
def test_a_pair_of_a_peer_moves_apart_as_hertz_says(code, monkeypatch):
    if reason := code.missing("cpu"):
        pytest.skip(reason)
    overlap, normal = 0.3, np.array([0.6, 0.0, 0.8])
    start = np.array([[0.0, 0.0, 0.0], (2.0 - overlap) * normal, [9.0, 9.0, 9.0]], dtype=np.float32)
    # a kick that is lost beside the force: 6e-4 µm in one step
    what = replace(spheres(3), start=start, kick=1e-9)
    monkeypatch.setattr(code, "spheres", lambda count: what)
    peer = code.Peer(3)
    peer.step(1)
    moved = peer.positions().astype(float) - start
    push = what.mobility * what.hardness * overlap**1.5 * normal
    # float32 coordinates of about 1 µm, and half a per mille for a table
    assert push @ normal > 1e-4
    assert np.abs(moved[0] + push).max() < 2e-7 + 5e-4 * push.max()
    assert np.abs(moved[1] - push).max() < 2e-7 + 5e-4 * push.max()
    assert np.abs(moved[2]).max() < 2e-6


def test_polynomials_are_as_good_as_float32():
    t = np.linspace(-0.5, 0.5, 1001)
    text = c_bead.horner(lambda t: np.log(1.5 + t), -0.5, 0.5, 9)
    value = eval(text.replace("f", ""), {"t": t})
    assert np.abs(value - np.log(1.5 + t)).max() < 2e-6


def test_case_a_relaxes_as_the_peers_do(device):
    scene, step = case_a()
    options = StepOptions(time_step=step, integrator="eulerMaruyama", allow_large_step=True)
    model = Model.build(scene, device=device, options=options)
    assert step / model.scales.trap_relaxation == pytest.approx(RELAXATION, rel=1e-4)
    assert model.features.driver == "solo" and not model.features.escapes


def test_the_robot_has_three_tables_and_a_full_mobility(device):
    model = Model.build(table_robot(), device=device)
    assert model.features.rigid and model.features.driver == "solo"
    assert model.held == ((0, 0), (0, 2), (0, 4))
    assert all("table" in name for name in model.features.trap_models) and model.features.traps == 3


def test_what_is_not_done_in_every_step_has_its_share(device):
    taken: list[int] = []
    setting = Setting(pick_device(device))
    for least in (1, 50):
        work = Workload(case="c", label="l", make=lambda _: Prepared(taken.append, 1, 1), least_steps=least)
        measured = TimedWorkload(work, work.make(setting), setting, 1e-9)
        measured.sample()
        assert taken[-1] == measured.steps >= least
    crowds = [w for w in workloads("cpu", BEAD_PEERS, MANY_BODY_PEERS) if w.case.startswith("crowd")]
    assert len(crowds) == 3 * (1 + len(MANY_BODY_PEERS)) and {w.least_steps for w in crowds} == {LISTED}


@pytest.mark.parametrize("kind", ["cpu", "cuda"])
def test_labels_and_cases(kind):
    rows = list(workloads(kind, BEAD_PEERS, MANY_BODY_PEERS))
    assert len({row.label for row in rows}) == len(rows)
    assert {row.case.split()[0] for row in rows} | {"threads"} == set(CASES)
    assert any("fast math" in row.label for row in rows) == (kind == "cuda")


def test_the_delivery_starts_anew(device):
    runner = next(w for w in workloads("cpu") if w.case == "delivery").make(Setting(pick_device(device)))
    simulation = runner.sim
    assert simulation is not None and runner.worlds == 1 and runner.per_step > 0.0
    whole = round(simulation.scene.settings.duration / simulation.time_step)
    start = simulation.state.position.numpy().copy()
    simulation.state.step = whole - 2
    runner.step(2)
    assert simulation.state.step == 0 and np.array_equal(simulation.state.position.numpy(), start)
    runner.step(5)
    assert simulation.state.step == 5


def row(label: str, **fields) -> SpeedRow:
    return SpeedRow(case="c", label=label, unit="steps/s", worlds=3, **fields)


def test_the_table_says_what_was_found():
    rows = (
        row("ours", rate=Quartiles(2e8, 1e8, 3e8), goal=1.2e8, check=1.0),
        row("slow", rate=Quartiles(1e7, 1e7, 1e7), ratio=Quartiles(0.05, 0.05, 0.05), goal=1e8),
        row("theirs", peer=True, skipped="nothing is installed"),
    )
    bench = SpeedBench(kind="cpu", hardware="a processor", machine={}, rounds=3, rows=rows)
    cells = table(bench, "Speed").rows
    assert all(len(line) == len(HEAD) for line in cells)
    assert cells[0] == ("ours", "3", "2e+08 (1e+08 – 3e+08)", "steps/s", "1", "1.2e+08 reached", "1.0000")
    assert cells[1][4:6] == ("0.05 (0.05 – 0.05)", "1e+08 missed")
    assert cells[2][:3] == ("→ theirs", NOTHING, "skipped: nothing is installed")
    assert "a processor; processor time" in caption(bench) and "of 3 repeats" in caption(bench)


def test_files(found, tmp_path: Path):
    numbers, picture = tmp_path / "speed.json", tmp_path / "speed.png"
    found.save(numbers)
    draw_speed(found, picture)
    read = json.loads(numbers.read_text())
    assert [r["label"] for r in read["rows"]] == [r.label for r in found.rows] and read["kind"] == found.kind
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert set(tmp_path.iterdir()) == {numbers, picture}
    with pytest.raises(InputError, match=r"absent/x\.png"):
        draw_speed(found, tmp_path / "absent" / "x.png")
    with pytest.raises(InputError, match=r"absent/x\.json"):
        found.save(tmp_path / "absent" / "x.json")
    with pytest.raises(InputError, match="nothing was measured"):
        draw_speed(replace(found, rows=(row("none", skipped="x"),)), picture)


def test_the_command_prints_the_table_and_writes_files(device, capfd, tmp_path: Path):
    file, scale = tmp_path / "speed.json", 16 / PARTICLES[kind_of(device)]
    options = ["--case", "bead", "--rounds", "1", "--seconds", "1e-4", "--scale", f"{scale:g}", "--device", device]
    assert main(["bench", "speed", *options, "--out", str(file)]) == 0
    out = capfd.readouterr().out
    assert "bead in a spring, heun" in out and "NumPy" in out and f"wrote {file}" in out and file.exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [({"cases": ["chess"]}, "--case is 'chess'; allowed: bead"), ({"rounds": 0}, "--rounds is 0"),
     ({"seconds": 0.0}, "--seconds is 0"), ({"scale": -1.0}, "--scale is -1")],
)  # fmt: skip
def test_bad_input(options, words):
    with pytest.raises(InputError, match=words) as caught:
        bench_speed(device="cpu", **options)
    assert "\n" not in str(caught.value)
