"""Folders of studies where something goes wrong: full disks, two at once, another scene, remains of the dead."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import shutil
import socket
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.files import ENOUGH
from otwarp.studies.axes import values
from otwarp.studies.differences import difference
from otwarp.studies.engines.local import keep, on_this_host
from otwarp.studies.engines.run import prepare, run_study
from otwarp.studies.file import load_study
from otwarp.studies.observables import trapped
from otwarp.studies.rare.study import EscapeStudy
from otwarp.studies.results import progress, table
from otwarp.studies.stopping.rules import budget
from otwarp.studies.store import RULES, Store, open_store, versions
from otwarp.studies.study import Study
from tests.full_disk import largest_file
from tests.studies.scenes import bead_in_a_well, short_study

pytest.importorskip("zarr")

SCENE = Path(__file__).parents[2] / "scenes" / "table_trap.usda"


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return bead_in_a_well(tmp_path_factory.mktemp("well"))


@pytest.fixture(scope="module")
def whole(scene, tmp_path_factory) -> Store:
    """What an undisturbed run gives."""
    return run_study(short_study(scene), tmp_path_factory.mktemp("whole") / "out", devices=["cpu"])


def whole_block(study: Study, store: Store, number: int) -> dict[str, np.ndarray]:
    """Arrays of a block as they were computed."""
    return {name: store.block(name, study.blocks()[number]) for name in ("trials", "end", "end_time")}


def same(store: Store, other: Store) -> bool:
    return store.read().load().identical(other.read().load())


def test_a_disk_that_fills_up(scene, whole, tmp_path):
    """The error names a file, finished blocks are kept, and with more room the study goes on to the same bits."""
    out = tmp_path / "out"
    with contextlib.ExitStack() as full:

        def filled(done: int, blocks: int) -> None:
            if done == 1:
                full.enter_context(largest_file(1))

        with pytest.raises(OSError, match="File too large") as error:
            run_study(short_study(scene), out, devices=["cpu"], progress=filled)
        assert str(out) in error.value.filename
        with pytest.raises(InputError, match="cannot be written"):  # before anything is computed
            run_study(short_study(scene), out, devices=["cpu"])
        with pytest.raises((InputError, OSError)):
            prepare(short_study(scene), tmp_path / "new")
    assert open_store(out).finished() == [0]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out"]
    assert np.sum(open_store(out).read()["trials"].values == 2_048) == 8
    assert same(run_study(short_study(scene), out, devices=["cpu"]), whole)


@pytest.mark.thorough
def test_no_room_for_the_folder(tmp_path, tmp_path_factory, capsys):
    """A disk that fills up while the folder is made, by the scene itself: one line, exit code 2, and nothing stays."""
    (tmp_path / "s.toml").write_text(
        f'scene = "{SCENE}"\n[[observable]]\nkind = "trapped"\nuntil = "5 ms"\n[stop]\ntrials = 8\n'
    )
    assert SCENE.stat().st_size > 2 * ENOUGH
    # kernels and force tables are in their caches then, which need room as well
    assert main(["study", "run", str(tmp_path / "s.toml"), "-o", str(tmp_path_factory.mktemp("there") / "out")]) == 0
    capsys.readouterr()
    with largest_file(ENOUGH):
        assert main(["study", "run", str(tmp_path / "s.toml"), "-o", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert f"{tmp_path / 'out'}: File too large; allowed: a disk with room" in said and said.count("\n") == 1
    assert [p.name for p in tmp_path.iterdir()] == ["s.toml"]


@pytest.mark.parametrize(
    ("line", "file"),
    [
        (["study", "export", "-o"], "x.nc"),
        (["study", "show", "--plot"], "x.png"),
        (["study", "show", "--plot"], "x.pdf"),
    ],
)
def test_no_room_for_what_is_written(whole, tmp_path, capsys, line, file):
    """Tables and pictures: one line, exit code 2, no remains, and nothing that was found before is lost."""
    wanted = tmp_path / file
    wanted.write_text("kept")
    with largest_file(ENOUGH):
        assert main([*line[:2], str(whole.folder), line[2], str(wanted)]) == 2
    said = capsys.readouterr().err
    assert f"{wanted}: File too large; allowed: a disk with room" in said and said.count("\n") == 1
    assert [p.name for p in tmp_path.iterdir()] == [file] and wanted.read_text() == "kept"
    assert main([*line[:2], str(whole.folder), line[2], str(wanted)]) == 0 and wanted.stat().st_size > ENOUGH


@pytest.mark.parametrize("written", range(4))
def test_a_block_that_is_half_written(scene, whole, tmp_path, monkeypatch, written):
    """Read between any two of its arrays, or left so by what ended it, it is not there, and it is computed anew."""
    study, out = short_study(scene), tmp_path / "out"
    store = run_study(study, out, devices=["cpu"], shard=(1, 3))
    seen, said = table(store), progress(store)
    put, calls = Store._put, 0

    def cut_off(at: Store, name: str, where: tuple[slice, ...], values: np.ndarray) -> None:
        nonlocal calls
        assert table(at).identical(seen) and progress(at) == said  # who looks while it is written
        if calls == written:
            raise OSError(errno.ENOSPC, "No space left on device")
        calls += 1
        put(at, name, where, values)

    monkeypatch.setattr(Store, "_put", cut_off)
    with contextlib.suppress(OSError):
        run_study(study, out, devices=["cpu"], shard=(2, 3))
    monkeypatch.undo()
    assert calls == min(written, 3)
    if written < 3:
        assert store.finished() == [0] and said["points_done"] == 8 and said["trials"] == 8 * 2_048
        assert table(store).identical(seen) and progress(store) == said
    assert same(run_study(study, out, devices=["cpu"]), whole)


@pytest.mark.parametrize(("task", "calls"), [([0, 1, 2], 3), ([1, 2], 3), ([0, 2], 6), ([2], 3)])
def test_blocks_of_a_task_are_written_together(scene, whole, tmp_path, monkeypatch, task, calls):
    """Each array in one call where they fill a box, else block by block: the same store."""
    study, put, written = short_study(scene), Store._put, []
    store, blocks = prepare(study, tmp_path / "out"), [whole_block(study, whole, n) for n in task]
    monkeypatch.setattr(Store, "_put", lambda at, name, *of: written.append(name) or put(at, name, *of))
    keep(study, store, task, blocks)
    assert len(written) == calls and written[-1] == "trials" and store.finished() == task
    assert same(run_study(study, store.folder, devices=["cpu"]), whole)


@pytest.mark.parametrize("written", range(3))
def test_a_round_that_is_half_written(scene, tmp_path, monkeypatch, written):
    """Blocks of a study with a budget grow: what `trials` counts is there, and what was cut off behind it is not."""
    axes = {"trap_power": values([0.2, 0.3], unit="mW")}
    rule = budget(200, at_least=16, at_most=128)
    study = Study(scene, axes=axes, observables=[trapped(until=0.004)], stop=rule, seed=3)
    put, calls = Store._put, 0

    def cut_off(at: Store, name: str, where: tuple[slice, ...], values: np.ndarray) -> None:
        nonlocal calls
        if calls == 3 + written:
            raise OSError(errno.ENOSPC, "No space left on device")
        calls += 1
        put(at, name, where, values)

    monkeypatch.setattr(Store, "_put", cut_off)
    with pytest.raises(OSError, match="No space"):
        run_study(study, tmp_path / "out", devices=["cpu"])
    monkeypatch.undo()
    store = open_store(tmp_path / "out")
    assert progress(store)["trials"] == 32 and table(store)["trials"].values.tolist() == [16, 16]
    first = study.between(np.zeros(2, int), np.full(2, 16)).compute([0], device="cpu")[0]
    held = np.mean(first["end"] == 0, axis=-1)
    assert np.allclose(table(store)["trapped"].values, held)


def test_a_half_written_point_of_escapes(scene, tmp_path):
    """Nothing of a point that is not marked as done: no rate, no interfaces, no steps."""
    axes = {"trap_power": values([0.3, 0.4], unit="mW")}
    study = EscapeStudy(scene, axes=axes, runs=2, branches=16, halved=False, seed=3)
    store = run_study(study, tmp_path / "out", devices=["cpu"])
    full = table(store)
    (store.folder / "done" / "000001").unlink()
    cut = table(store)
    assert cut.isel(trap_power=0).identical(full.isel(trap_power=0, interface=slice(0, cut.sizes["interface"])))
    rest = cut.isel(trap_power=1)
    assert rest["trials"] == rest["faults"] == rest["steps"] == 0 and progress(store)["points_done"] == 1
    assert all(np.all(np.isnan(rest[name])) for name in ("escape_rate", "flux", "probability", "interface_at", "basin"))


def test_two_that_begin_at_once(scene, tmp_path):
    """A folder that another process makes in the meantime, and fills, is found and not made anew."""
    study, out = short_study(scene), tmp_path / "out"
    gate = threading.Barrier(6)
    made: list[Store] = []

    def begin() -> None:
        gate.wait()
        made.append(prepare(study, out))

    threads = [threading.Thread(target=begin) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(made) == 6
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out"]
    run_study(study, out, devices=["cpu"], shard=(1, 3))
    prepare(study, out)
    assert open_store(out).finished() == [0]
    assert int(open_store(out).read()["trials"].values.max()) == 2_048


def test_remains_of_a_killed_process_go(scene, tmp_path):
    """What a process left that was killed while it made a folder: removed by the next, unless its owner lives."""
    child = subprocess.Popen([sys.executable, "-c", ""])
    child.wait()
    dead, alive = (tmp_path / f".out.part-{socket.gethostname()}-{pid}-x" for pid in (child.pid, os.getpid()))
    for folder in (dead, alive):
        folder.mkdir()
    prepare(short_study(scene), tmp_path / "out")
    assert not dead.exists() and alive.exists()


def test_a_changed_scene_is_refused_with_the_difference(scene, whole, tmp_path):
    """Value by value; a scene that only lies elsewhere is the same one."""
    moved = tmp_path / "elsewhere.usda"
    shutil.copy(scene, moved)
    run_study(short_study(moved), whole.folder, devices=["cpu"])
    (tmp_path / "other").mkdir()
    other = bead_in_a_well(tmp_path / "other", stiffness=0.6)
    with pytest.raises(InputError, match=r"traps\[0\]\.radial\.stiffness is 0\.5 there, 0\.6 now"):
        run_study(short_study(other), whole.folder, devices=["cpu"])


def test_another_version_is_refused_unless_it_is_allowed(scene, whole, tmp_path):
    """Where there is something to compute; then each block says by which versions it was. Older folders say less."""
    said = json.loads((whole.folder / "study.json").read_text())
    assert said["versions"].keys() == {"otwarp", "warp", "numpy", "python"}
    for name in ("otwarp", "warp", "numpy", "python"):
        copied = tmp_path / name
        shutil.copytree(whole.folder, copied)
        (copied / "study.json").write_text(json.dumps(said | {"versions": said["versions"] | {name: "0.0.1"}}))
        run_study(short_study(scene), copied, devices=["cpu"])  # all is there
        (copied / "done" / "000001").write_text("")
        (copied / "done" / "000002").unlink()
        if name != "python":
            with pytest.raises(InputError, match=rf"begun with {name} 0\.0\.1, .* now; allowed: .*--allow-version"):
                run_study(short_study(scene), copied, devices=["cpu"])
            assert open_store(copied).finished() == [0, 1]
            with pytest.warns(UserWarning, match="blocks may differ in their last bits"):
                run_study(short_study(scene), copied, devices=["cpu"], allow_version=True)
        else:
            run_study(short_study(scene), copied, devices=["cpu"])
        assert json.loads((copied / "done" / "000002").read_text()) == versions()
    (copied / "done" / "000002").unlink()
    older = {k: v for k, v in said["versions"].items() if k != "numpy"}
    (copied / "study.json").write_text(json.dumps(said | {"versions": older}))
    assert same(run_study(short_study(scene), copied, devices=["cpu"]), whole)


@pytest.mark.parametrize("begun", [None, RULES - 1, RULES + 1])
def test_a_study_that_was_begun_by_other_rules_is_refused(scene, tmp_path, capsys, begun):
    """Older folders do not say theirs. One line with both versions and what to do, exit code 2; results can be read."""
    file, out = tmp_path / "s.toml", tmp_path / "out"
    file.write_text(f'scene = "{scene}"\n[stop]\ntrials = 8\n[[observable]]\nkind = "trapped"\nuntil = "4 ms"\n')
    run_study(load_study(file), out, devices=["cpu"])
    said = json.loads((out / "study.json").read_text())
    assert said.pop("rules") == RULES
    (out / "study.json").write_text(json.dumps(said | ({} if begun is None else {"rules": begun})))
    (out / "done" / "000000").unlink()
    assert main(["study", "run", str(file), "-o", str(out)]) == 2
    error = capsys.readouterr().err
    assert f"begun by version {begun or 1} of the rules of studies, this otwarp has version {RULES}; allowed:" in error
    assert error.count("\n") == 1 and open_store(out).finished() == []
    assert main(["study", "status", str(out)]) == 0


def test_a_folder_keeps_the_texts_that_it_was_made_from(tmp_path):
    """The study's file and those of its functions: of two files of one name both, and nothing of otwarp's own."""
    bead_in_a_well(tmp_path)
    text = 'scene = "well.usda"\n[stop]\ntrials = 8\n[[observable]]\nkind = "trapped"\nuntil = "4 ms"\n'
    for place, axis in (("a", 0), ("b", 2)):
        (tmp_path / place).mkdir()
        (tmp_path / place / "own.py").write_text(
            "import otwarp as ot\n\n@ot.observable()\ndef at(now: ot.WorldNow) -> float:\n"
            f"    return now.state.position[now.world, 0][{axis}]\n"
        )
        text += f'[[observable]]\nfile = "{place}/own.py"\nfunction = "at"\nname = "at_{place}"\n'
    (tmp_path / "s.toml").write_text(text)
    out = run_study(load_study(tmp_path / "s.toml"), tmp_path / "out", devices=["cpu"]).folder
    assert (out / "study.toml").read_text() == text
    kept = {p.name: p.read_text() for p in (out / "sources").iterdir()}
    assert kept == {"own.py": (tmp_path / "a/own.py").read_text(), "own_2.py": (tmp_path / "b/own.py").read_text()}


def test_a_folder_without_its_results(scene, whole, tmp_path):
    """One line, not a traceback of zarr's; likewise to go on."""
    broken = tmp_path / "out"
    shutil.copytree(whole.folder, broken)
    shutil.rmtree(broken / "results.zarr")
    (broken / "done" / "000001").unlink()
    for read in (open_store(broken).read, lambda: run_study(short_study(scene), broken, devices=["cpu"])):
        with pytest.raises(InputError, match=r"results\.zarr: is not there; allowed: the folder as otwarp study run"):
            read()


def test_difference():
    """The first place, or none."""
    assert difference({"a": [1, {"b": 2.0}]}, {"a": [1, {"b": 2.0}]}) is None
    assert difference({"a": [1, {"b": 2.0}]}, {"a": [1, {"b": 3.0}]}) == ("a[1].b", "2.0", "3.0")
    assert difference({"a": 1}, {}) == ("a", "1", "none")
    assert difference([1], [1, 2]) == (" (its length)", "1", "2")
    assert difference({"a": np.array([1.0, np.nan])}, {"a": np.array([1.0, np.nan])}) is None


def test_devices_side_by_side(scene, whole, tmp_path):
    """Several devices, one thread that writes: the same bits, each block said once."""
    said: list[int] = []
    engine = on_this_host(["cpu", "cpu"])
    store = run_study(short_study(scene), tmp_path / "out", engine=engine, progress=lambda done, _: said.append(done))
    assert said == [0, 1, 2, 3] and same(store, whole)


def test_results_that_go_while_a_study_runs_end_it(scene, tmp_path):
    """zarr would write what follows into folders that it makes anew, and all blocks would be marked as done."""
    out = tmp_path / "out"

    def gone(done: int, of: int) -> None:
        if done == 1:
            shutil.rmtree(out / "results.zarr")

    with pytest.raises(FileNotFoundError, match=r"results\.zarr") as caught:
        run_study(short_study(scene), out, devices=["cpu"], progress=gone)
    assert Path(caught.value.filename).name == "zarr.json"
    assert [mark.name for mark in (out / "done").iterdir()] == ["000000"]
    assert not (out / "results.zarr").exists()
