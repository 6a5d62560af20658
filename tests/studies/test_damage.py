"""Folders of studies that are damaged, or that a copy has left incomplete: told by their file, or completed."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.studies.axes import grid
from otwarp.studies.engines.run import prepare, run_study
from otwarp.studies.observables import trapped
from otwarp.studies.results import progress, table
from otwarp.studies.stopping.rules import budget
from otwarp.studies.store import Store, open_store
from otwarp.studies.study import Study
from tests.studies.scenes import bead_in_a_well, short_study

pytest.importorskip("zarr")


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return bead_in_a_well(tmp_path_factory.mktemp("well"))


@pytest.fixture(scope="module")
def whole(scene, tmp_path_factory) -> Store:
    """What an undisturbed run gives."""
    return run_study(short_study(scene), tmp_path_factory.mktemp("whole") / "out", devices=["cpu"])


def emptied(file: Path) -> None:
    file.write_bytes(b"")


def garbled(file: Path) -> None:
    file.write_bytes(b"garbage")


def removed(file: Path) -> None:
    shutil.rmtree(file) if file.is_dir() else file.unlink()


@pytest.mark.parametrize(
    ("file", "damage", "said"),
    [
        ("results.zarr/end/c/1/0/0", garbled, "end/c/1/0/0: is damaged (Zstd decompression error"),
        ("results.zarr/trials/c/2/0", emptied, "trials/c/2/0: is damaged ("),
        ("results.zarr/trap_power/c/0", garbled, "trap_power/c/0: is damaged ("),
        ("results.zarr/zarr.json", emptied, "results.zarr/zarr.json: is damaged ("),
        ("results.zarr/trials/zarr.json", garbled, "trials/zarr.json: is damaged ("),
        ("results.zarr/end/zarr.json", garbled, "end/zarr.json: is damaged ("),
        (
            "results.zarr/trials",
            removed,
            "trials/zarr.json: is not there; allowed: the folder as otwarp",
        ),
        ("results.zarr/end", removed, "end: is not there; allowed: the folder as otwarp"),
        ("results.zarr/trap_power", removed, "trap_power: is not there; allowed: the folder as otwarp"),
    ],
)
def test_damaged_results_are_named(whole, tmp_path, capsys, file, damage, said):
    """In one line, whoever reads them."""
    out = shutil.copytree(whole.folder, tmp_path / "out")
    damage(out / file)
    for words in (["status", str(out)], ["show", str(out)], ["export", str(out), "-o", str(tmp_path / "x.nc")]):
        assert main(["study", *words]) == 2
        error = capsys.readouterr().err
        assert said in error and error.count("\n") == 1
    assert not (tmp_path / "x.nc").exists()


@pytest.mark.parametrize("name", ["scene", "observables", "stop", "blocks", "axes", "versions"])
def test_a_study_that_says_nonsense_of_itself(whole, tmp_path, name):
    out = shutil.copytree(whole.folder, tmp_path / "out")
    said = json.loads((out / "study.json").read_text()) | {name: "nonsense"}
    (out / "study.json").write_text(json.dumps(said))
    with pytest.raises(InputError, match=rf"study\.json: {name} = .*nonsense"):
        open_store(out)


def test_blocks_whose_outcomes_were_lost_are_computed_again(scene, whole, tmp_path):
    """A copy may lack a chunk, which zarr takes for one that was never written: those trials would go on for ever."""
    out = shutil.copytree(whole.folder, tmp_path / "out")
    (out / "results.zarr" / "end" / "c" / "1" / "0" / "0").unlink()
    (out / "done" / "000099").touch()
    (out / "done" / "000002").unlink()
    (out / "done" / "000002").mkdir()
    assert open_store(out).finished() == [0]
    assert progress(open_store(out))["points_done"] == whole.trials().size // 3
    (out / "done" / "000002").rmdir()
    run_study(short_study(scene), out, devices=["cpu"])
    assert open_store(out).finished() == [0, 1, 2]
    assert table(open_store(out)).identical(table(whole))


def test_ends_without_their_times_are_refused(whole, tmp_path):
    out = shutil.copytree(whole.folder, tmp_path / "out")
    shutil.rmtree(out / "results.zarr" / "end_time" / "c")
    with pytest.raises(InputError, match=r"end_time: of \d+ of \d+ trials that ended the time is not there; allowed"):
        table(open_store(out))


def test_a_folder_without_its_empty_one_goes_on(scene, whole, tmp_path):
    """As copies by git and by stores of objects leave it."""
    study = short_study(scene)
    prepare(study, tmp_path / "out")
    (tmp_path / "out" / "done").rmdir()
    run_study(study, tmp_path / "out", devices=["cpu"])
    assert table(open_store(tmp_path / "out")).identical(table(whole))


def test_counted_trials_without_outcomes_are_refused(scene, tmp_path):
    """Of a study with a budget no mark says what is whole."""
    study = Study(scene, axes={"trap_power": grid(0.2, 1.0, 2, unit="mW")}, observables=[trapped(until=0.004)],
                  stop=budget(256), seed=3)  # fmt: skip
    store = run_study(study, tmp_path / "out", devices=["cpu"])
    for chunk in (store.results / "end" / "c").rglob("*"):
        if chunk.is_file():
            chunk.unlink()
    with pytest.raises(InputError, match=r"end: outcomes of \d+ of \d+ blocks are not there"):
        progress(open_store(tmp_path / "out"))
