"""Who computes a study does not matter: Ray whose nodes are lost and come, drivers that are killed, shards beside."""

from __future__ import annotations

import contextlib
import http.server
import importlib.util
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import otwarp as ot
from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.studies.engines.local import on_this_host, tasks
from otwarp.studies.engines.on_ray import ray_engine, wanted_by_a_task
from otwarp.studies.engines.run import run_study
from otwarp.studies.engines.sent import packed, unpacked
from otwarp.studies.file import load_study
from otwarp.studies.store import open_store
from tests.studies.scenes import study_of_a_well

pytest.importorskip("zarr")
needs_ray = pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="Ray is not installed")

FILE = study_of_a_well(12, 2_048)
"""That of `folder` (conftest.py)."""


@ot.observable(keep="largest", unit="µm")
def height(now: ot.WorldNow, body: int = 0) -> float:  # type: ignore[valid-type]
    """Of this file, which workers may not be able to import."""
    return now.state.position[now.world, body][2]


def command(folder: Path, out: Path, *more: str) -> list[str]:
    line = [sys.executable, "-m", "otwarp", "study", "run", str(folder / "s.toml"), "--device", "cpu"]
    return [*line, "-o", str(out), *more]


def begin(line: list[str]) -> subprocess.Popen:
    return subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


@contextlib.contextmanager
def cluster():
    """A head that computes nothing, and two nodes of a core each."""
    utils = pytest.importorskip("ray.cluster_utils")
    made = utils.Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
    try:
        yield made, [made.add_node(num_cpus=1) for _ in range(2)]
    finally:
        made.shutdown()


@needs_ray
def test_a_ray_that_does_not_run_here(folder, tmp_path, capsys, monkeypatch):
    """`--address auto` is found out before a folder is made. In this file, as others' clusters here are found, too."""
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    line = ["study", "run", str(folder / "s.toml"), "-o", str(tmp_path / "out"), "--engine", "ray"]
    assert main([*line, "--address", "auto"]) == 2
    assert "--address is auto: Could not find any running Ray" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.quick
@needs_ray
@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("127.0.0.1:1", "where nothing answers"),
        ("nohost.invalid:6379", "where nothing answers"),
        ("head", "HOST:PORT"),
        ("ray://127.0.0.1:10001", "HOST:PORT"),
    ],
)
def test_an_address_where_no_cluster_is(folder, tmp_path, capsys, address, said):
    """One line, exit code 2, at once, and no folder."""
    more = ["--engine", "ray", "--address", address]
    assert main(["study", "run", str(folder / "s.toml"), "-o", str(tmp_path / "out"), *more]) == 2
    assert said in (error := capsys.readouterr().err) and address in error and error.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.quick
@needs_ray
def test_something_else_than_ray_answers():
    """A web server, say."""
    with http.server.HTTPServer(("127.0.0.1", 0), http.server.SimpleHTTPRequestHandler) as server:
        threading.Thread(target=server.handle_request, daemon=True).start()
        with pytest.raises(InputError, match="something else than Ray"):
            ray_engine(f"127.0.0.1:{server.server_port}")


@pytest.mark.quick
def test_engines_that_cannot_be(folder, tmp_path, capsys, monkeypatch):
    """Without Ray, with shards, an address without an engine: one line each."""
    run = ["study", "run", str(folder / "s.toml"), "-o", str(tmp_path / "out")]
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    for more, said in (
        (["--engine", "ray"], "install otwarp[ray]"),
        (["--engine", "ray", "--shard", "1/2"], "--shard is 1/2"),
        (["--engine", "ray", "--device", "cuda:1"], "Ray's choice"),
        (["--address", "head:6379"], "with --engine ray alone"),
    ):
        assert main([*run, *more]) == 2
        assert said in (error := capsys.readouterr().err) and error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_tasks_of_gpus(folder):
    """They fill a device, leave no other idle, and are short enough that not much is lost with one."""
    study = ot.Study(
        folder / "well.usda",
        axes={"trap_power": ot.grid(0.2, 1.0, 4_096, unit="mW")},
        observables=[ot.trapped(until=1.0)],
        stop=ot.trials(1_024),
    )
    todo = range(len(study.blocks()))
    assert len(todo) == 64
    assert [len(t) for t in tasks(study, todo, gpu=True)] == [16] * 4
    assert [len(t) for t in tasks(study, todo, gpu=True, workers=8)] == [8] * 8
    assert [len(t) for t in tasks(study, todo, gpu=False)] == [1] * 64
    long = ot.Study(
        folder / "well.usda",
        axes={"trap_power": ot.grid(0.2, 1.0, 4_096, unit="mW")},
        observables=[ot.trapped(until=1e4)],
        stop=ot.trials(1_024),
    )
    points = len(long.blocks())  # each is a block of its own
    assert long.runner.steps > 2**20 and points == 4_096
    assert {len(t) for t in tasks(long, range(points), gpu=True)} == {2**16 // 1_024}
    escapes = ot.EscapeStudy(folder / "well.usda", axes={"trap_power": ot.grid(0.5, 1.0, 3, unit="mW")})
    assert tasks(escapes, range(3), gpu=True) == [[0], [1], [2]]  # one after the other: kept as soon as it is known


@pytest.mark.quick
def test_a_task_of_ray_asks_for_a_gpu_where_there_are_some():
    """One each, whatever the cluster has; a core alone where there is none, or where a CPU is wanted."""
    gpu, core = {"num_gpus": 1, "num_cpus": 1}, {"num_cpus": 1}
    assert wanted_by_a_task({"CPU": 16.0, "GPU": 8.0}, None) == wanted_by_a_task({"GPU": 1.0}, "cuda") == gpu
    assert wanted_by_a_task({"CPU": 16.0}, None) == wanted_by_a_task({"CPU": 2.0, "GPU": 8.0}, "cpu") == core
    with pytest.raises(InputError, match="it has no GPU"):
        wanted_by_a_task({"CPU": 16.0, "GPU": 0.0}, "cuda")


@needs_ray
def test_ray_gives_each_task_a_gpu_of_its_own():
    """A node that says that it has two, as Ray counts what nodes say: two tasks at once, each of which sees one."""
    import ray

    with cluster() as (made, _):
        made.add_node(num_cpus=4, num_gpus=2)
        ray.init(str(made.address), log_to_driver=False)
        try:
            asked = wanted_by_a_task(ray.cluster_resources(), None)
            seen = ray.remote(**asked)(lambda: (time.sleep(1.0), os.environ["CUDA_VISIBLE_DEVICES"])[1])
            assert sorted(ray.get([seen.remote() for _ in range(2)])) == ["0", "1"]
        finally:
            ray.shutdown()


def test_nodes_that_are_lost_and_come(folder, whole, tmp_path):
    """One of two nodes is killed in mid-work and another one joins: bit for bit the one process's."""
    with cluster() as (made, nodes):
        changed = False

        def change(done: int, blocks: int) -> None:
            nonlocal changed
            if done >= 1 and not changed:
                changed = True
                made.remove_node(nodes[1], allow_graceful=False)
                made.add_node(num_cpus=1)

        engine = ray_engine(str(made.address), device="cpu")
        store = run_study(load_study(folder / "s.toml"), tmp_path / "out", engine=engine, progress=change)
        assert changed and store.read().load().identical(whole)
        # the driver is killed, and started again; shards beside it change nothing
        out = tmp_path / "driver"
        line = command(folder, out, "--engine", "ray", "--address", str(made.address))
        driver = begin(line)
        while not (out / "done").is_dir() or not any((out / "done").iterdir()):
            assert driver.poll() is None
            time.sleep(0.01)
        driver.send_signal(signal.SIGKILL)
        driver.wait()
        assert len(open_store(out).finished()) < 6
        shard = begin(command(folder, out, "--shard", "2/2"))
        assert subprocess.run(line, capture_output=True, text=True).returncode == 0
        assert shard.wait() == 0
        assert open_store(out).read().load().identical(whole)
        # a second driver is refused
        (out / "done" / "000005").unlink()
        with open_store(out).claimed():
            refused = subprocess.run(line, capture_output=True, text=True)
        assert refused.returncode == 2 and "another process runs this study" in refused.stderr


@pytest.mark.quick
def test_a_study_as_bytes(folder):
    """A process that has never heard of this file makes the same numbers of it."""
    study = ot.Study(
        folder / "well.usda",
        axes={"trap_power": ot.values([0.5, 1.0], unit="mW"), "/World/bead/sphere.radius": ot.values([0.5], unit="µm")},
        observables=[ot.trapped(until=0.001), height],
        stop=ot.trials(4),
    )
    study.plan()
    data = packed(study, folder / "well.usda")
    assert b"test_engines" not in data
    again = unpacked(data)
    assert again.asked() == study.asked()
    (a,), (b,) = (s.compute([0], device="cpu") for s in (study, again))
    assert all(np.array_equal(a[name], b[name], equal_nan=a[name].dtype.kind == "f") for name in a)


def test_one_point(folder, tmp_path):
    """A study without axes."""
    study = ot.Study(folder / "well.usda", observables=[ot.trapped(until=0.001)], stop=ot.trials(4))
    assert run_study(study, tmp_path / "out", devices=["cpu"]).read()["trials"].item() == 4


def test_functions_of_ones_own_reach_the_workers(folder, tmp_path):
    """A number that a function in this file reads, by Ray on this host alone: as in this process."""
    pytest.importorskip("ray")
    study = ot.Study(
        folder / "well.usda",
        axes={"trap_power": ot.values([0.5, 1.0], unit="mW")},
        observables=[ot.trapped(until=0.01), height],
        stop=ot.trials(64),
    )
    a, b = (
        run_study(study, tmp_path / name, devices=["cpu"], engine=engine)
        for name, engine in (("here", None), ("ray", ray_engine(device="cpu")))
    )
    found = b.read().load()
    assert a.read().load().identical(found)
    assert np.all(found["height_of_trial"] > 9.0)


def test_kills_at_any_moment(folder, whole, tmp_path):
    """kill -9 at ten random moments of a run, each time the same line again: the bits of an undisturbed one."""
    moments = np.random.default_rng(1).uniform(0.3, 6.0, 10)
    out = tmp_path / "killed"
    for moment in moments:
        child = begin(command(folder, out))
        with contextlib.suppress(subprocess.TimeoutExpired):
            child.wait(moment)
        child.kill()
        child.wait()
    assert main(command(folder, out)[3:]) == 0
    assert open_store(out).read().load().identical(whole)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["killed"]


ESCAPES = """
scene = "well.usda"
seed = 3
[[axis]]
name = "trap_power"
values = [0.3, 0.35, 0.4, 0.5]
unit = "mW"
[escape]
order = "energy"
runs = 4
branches = 500
relax = "0.1 s"
"""
"""Four blocks."""


def test_kills_of_a_study_of_escapes(folder, tmp_path):
    """kill -9 in the midst of a block, three times, and at last Ray: the bits of an undisturbed run."""
    (folder / "escapes.toml").write_text(ESCAPES)
    whole, out = tmp_path / "whole", tmp_path / "killed"
    line = [sys.executable, "-m", "otwarp", "study", "run", str(folder / "escapes.toml"), "--device", "cpu", "-o"]
    assert main([*line[3:], str(whole)]) == 0
    done = out / "done"
    for pause in np.random.default_rng(2).uniform(0.0, 0.6, 3):
        before = len(list(done.glob("*")))
        child = begin([*line, str(out)])
        while child.poll() is None and len(list(done.glob("*"))) == before:
            time.sleep(0.01)
        with contextlib.suppress(subprocess.TimeoutExpired):
            child.wait(pause)
        child.kill()
        child.wait()
    assert open_store(out).finished()
    (done / "000003").unlink(missing_ok=True)
    engine = ["--engine", "ray"] if importlib.util.find_spec("ray") is not None else []
    assert main([*line[3:], str(out), *engine]) == 0
    assert open_store(out).read().load().identical(open_store(whole).read().load())


RULES = {
    "widths": "half_width = 0.03\nat_most = 2048",
    "contour": "contour = 0.5\nhalf_width = 0.03",
    "budget": "contour = 0.5\nhalf_width = 0.03\nbudget = 20_000",
    "largest": 'largest = 0.5\nalong = "start.x:/World/bead"\ntrials = 1024',
}
"""Ways to stop that decide by what was seen."""


@pytest.mark.parametrize("stop", RULES.values(), ids=RULES)
def test_every_engine_under_every_rule(folder, tmp_path, stop):
    """Two devices side by side, shards in another order, and Ray: the bits of one device."""
    file = folder / "rule.toml"
    file.write_text(FILE.replace("trials = 2048", stop))
    ways: dict[str, list[dict[str, Any]]] = {
        "one": [{"devices": ["cpu"]}],
        "two": [{"engine": on_this_host(["cpu", "cpu"])}],
    }
    if "budget" not in stop:  # all points share it
        ways["shards"] = [{"devices": ["cpu"], "shard": (n, 3)} for n in (3, 1, 2)]
    if importlib.util.find_spec("ray") is not None:
        ways["ray"] = [{"engine": ray_engine(device="cpu")}]
    found = {}
    for name, runs in ways.items():
        for how in runs:
            store = run_study(load_study(file), tmp_path / name, **how)
        assert len(store.finished()) == len(load_study(file).blocks()) > 2
        found[name] = store.read().load()
    assert all(one.identical(found["one"]) for one in found.values())
    assert len(np.unique(found["one"]["trials"])) > 1


def test_shards_that_begin_together(folder, whole, tmp_path):
    """Three shards and a driver of all on a folder that none has made yet."""
    out = tmp_path / "out"
    lines = [command(folder, out, "--shard", f"{n}/3") for n in (1, 2, 3)] + [command(folder, out)]
    assert [child.wait() for child in [begin(line) for line in lines]] == [0, 0, 0, 0]
    assert open_store(out).read().load().identical(whole)
    assert [p.name for p in tmp_path.iterdir()] == ["out"]
