"""Data sets on disk: labels, checksums, the same bits however they were made, and what is refused."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.vision.datasets import load_spec, make_dataset, open_dataset
from otwarp.vision.datasets.labels import labels_of
from otwarp.vision.datasets.shots import pose_images, pose_intensities
from otwarp.vision.datasets.store import Store
from otwarp.vision.fourier import Fourier
from otwarp.vision.rendering import render
from otwarp.vision.sensor import NOISE
from tests.vision.datasets.small import TEXT, written

pytest.importorskip("zarr")
SHIPPED = Path(__file__).parents[3] / "vision"


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("small")
    return make_dataset(written(folder), folder / "out", device="cpu")


@pytest.mark.quick
def test_a_data_set_is_made_by_the_command_and_read(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["vision", "dataset", str(written(tmp_path)), "--out", str(out), "--processes", "1"]) == 0
    said, errors = capfd.readouterr()
    assert "5 poses, 48 images of 32 × 32 pixels" in said and "pose 5 of 5" in errors
    found = open_dataset(out)
    found.verify()
    assert (found.count, found.shape) == (48, (32, 32)) and found.classes.tolist() == [0, 40, 90]
    assert found.images(slice(0, 2)).shape == (2, 32, 32) and found.images([47, 3]).dtype == np.uint8
    assert {n: len(r) for n, r in found.split("random").items()} == {"train": 18, "validation": 9, "test": 9}
    assert (out / "samples.png").stat().st_size > 5000 and "| random | 18 | 9 | 9 |" in (out / "README.md").read_text()
    assert not (out / "done").exists() and not (out / "driver.lock").exists()
    assert main(["vision", "dataset", str(tmp_path / "small.toml"), "--out", str(out), "--processes", "1"]) == 0


def test_labels_are_what_was_rendered(small: Path) -> None:
    found = open_dataset(small)
    row = 30
    label = {name: values[row] for name, values in found.labels.items()}
    spec = load_spec(small.parent / "small.toml")
    turned = spec.robot.at(label["tilt"], label["yaw"])
    there = turned.moved([label["x"], label["y"], label["depth"]])  # above a focal plane at height 0
    alone = render(there, spec.microscope, 32, rendering=spec.rendering, fourier=Fourier("cpu"))[0]
    light = pose_intensities(labels_of(spec), int(label["pose"]), Fourier("cpu"), np.array([row]))[0]
    # slices lie elsewhere; light that leaves the small square comes in again elsewhere
    assert np.sqrt(np.mean((alone - light) ** 2) / np.mean((alone - 1) ** 2)) < 0.12
    levels = found.images(row)[0] / 255 / label["brightness"]
    assert np.corrcoef(levels.ravel(), light.ravel())[0, 1] > 0.97


def test_threads_change_no_bit(small: Path) -> None:
    labels, rows = labels_of(load_spec(small.parent / "small.toml")), open_dataset(small)
    there = rows.images(labels.rows(1))
    for threads in (None, 3):
        assert np.array_equal(pose_images(labels, 1, Fourier("cpu"), threads=threads), there)


def test_a_data_set_of_other_noise_is_not_gone_on_with(small: Path, tmp_path: Path) -> None:
    shutil.copytree(small, tmp_path / "old")
    manifest = tmp_path / "old" / "manifest.json"
    said = json.loads(manifest.read_text())
    assert said.pop("noise") == NOISE
    manifest.write_text(json.dumps(said))
    with pytest.raises(InputError, match=f"another noise: None there, {NOISE} now; allowed: the same file, or a new"):
        make_dataset(small.parent / "small.toml", tmp_path / "old", device="cpu")
    assert open_dataset(tmp_path / "old").count == 48  # what is whole can be read


def test_several_processes_and_interruptions_change_no_bit(small: Path, tmp_path: Path) -> None:
    file = small.parent / "small.toml"
    labels = labels_of(load_spec(file))
    whole = open_dataset(small).images(slice(None))

    class Interrupted(Exception):
        pass

    def stop(done: int, poses: int) -> None:
        if done == 2:
            raise Interrupted

    with pytest.raises(Interrupted):
        make_dataset(labels, tmp_path / "again", device="cpu", progress=stop)
    with pytest.raises(InputError, match="is not finished, 2 of 5 poses"):
        open_dataset(tmp_path / "again")
    of_killed = tmp_path / "again" / "data.zarr" / "images" / "c" / "4" / "0" / "0.5f2c.partial"
    of_killed.parent.mkdir(parents=True)
    of_killed.write_bytes(b"half a chunk, as zarr leaves it")
    make_dataset(labels, tmp_path / "again", device="cpu", processes=2)
    again = open_dataset(tmp_path / "again")
    assert not of_killed.exists()
    assert np.array_equal(again.images(slice(None)), whole)
    sums = [json.loads((folder / "checksums.json").read_text()) for folder in (small, tmp_path / "again")]
    assert sums[0] == sums[1]


def test_what_is_left_of_the_making_goes_with_the_next_call(small: Path, tmp_path: Path) -> None:
    """A process may be killed right after it has written the checksums."""
    there = shutil.copytree(small, tmp_path / "there")
    (there / "done").mkdir()
    (there / "driver.lock").touch()
    make_dataset(small.parent / "small.toml", there, device="cpu")
    assert sorted(p.name for p in there.iterdir()) == sorted(p.name for p in small.iterdir())


def test_a_killed_command_goes_on(small: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    line = [sys.executable, "-m", "otwarp", "vision", "dataset", str(small.parent / "small.toml"), "-o", str(out),
            "--processes", "2", "--device", "cpu"]  # fmt: skip
    begun = subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        while begun.poll() is None and not Store(out).finished():
            time.sleep(0.02)
    finally:
        begun.send_signal(signal.SIGKILL)
        begun.wait()
    done = subprocess.run(line, capture_output=True, text=True, env=dict(os.environ))
    assert done.returncode == 0, done.stderr
    assert np.array_equal(open_dataset(out).images(slice(None)), open_dataset(small).images(slice(None)))


def test_a_corrupt_or_lost_chunk_is_named(small: Path, tmp_path: Path) -> None:
    import shutil

    copy = tmp_path / "copy"
    shutil.copytree(small, copy)
    chunk = copy / "data.zarr" / "images" / "c" / "3" / "0" / "0"
    bytes_ = bytearray(chunk.read_bytes())
    bytes_[len(bytes_) // 2] ^= 1
    chunk.write_bytes(bytes_)
    found = open_dataset(copy)
    assert len(found.images(slice(0, 18))) == 18
    for read in (lambda: found.images([20]), found.verify):
        with pytest.raises(InputError, match=r"images/c/3/0/0: is corrupt, its SHA-256 is .*allowed: "):
            read()
    chunk.unlink()
    with pytest.raises(InputError, match=r"images/c/3/0/0: cannot be read"):
        found.images([20])
    label = copy / "data.zarr" / "depth" / "c" / "0"
    label.write_bytes(label.read_bytes()[:-1])
    with pytest.raises(InputError, match="depth/c/0: is corrupt"):
        open_dataset(copy)


@pytest.fixture(scope="module")
def begun(small: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same data set, ended after two poses."""

    def stop(done: int, poses: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    out = tmp_path_factory.mktemp("begun") / "out"
    with pytest.raises(KeyboardInterrupt):
        make_dataset(small.parent / "small.toml", out, device="cpu", progress=stop)
    return out


def test_a_data_set_goes_on_without_its_empty_folder(small: Path, begun: Path, tmp_path: Path) -> None:
    """Git and archives leave it out."""
    there = shutil.copytree(begun, tmp_path / "there")
    shutil.rmtree(there / "done")
    make_dataset(small.parent / "small.toml", there, device="cpu")
    assert (there / "checksums.json").read_bytes() == (small / "checksums.json").read_bytes()


@pytest.mark.parametrize("what", ["file", "link"])
def test_something_else_in_the_place_of_that_folder_is_one_line(
    small: Path, begun: Path, tmp_path: Path, what: str
) -> None:
    there = shutil.copytree(begun, tmp_path / "there")
    shutil.rmtree(there / "done")
    if what == "file":
        (there / "done").write_text("yes")
    else:
        (there / "done").symlink_to(tmp_path / "gone")
    with pytest.raises(InputError, match=r"^.*/there/done: is no folder; allowed: the one that was made, or none$"):
        make_dataset(small.parent / "small.toml", there, device="cpu")


@pytest.mark.parametrize("text", ["[]", "5", "{}", '{"zarr.json": 5}', "null", "{"])
def test_checksums_that_are_none_are_one_line(small: Path, tmp_path: Path, text: str) -> None:
    there = shutil.copytree(small, tmp_path / "there")
    (there / "checksums.json").write_text(text)
    for take in (lambda: open_dataset(there), lambda: make_dataset(small.parent / "small.toml", there, device="cpu")):
        with pytest.raises(InputError, match=r"checksums.json: .*; allowed: what otwarp vision dataset wrote"):
            take()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"count": None}, "count = None; allowed: what otwarp vision dataset wrote"),
        ({"count": "a"}, "count = 'a'; allowed: what"),
        ({"count": 47}, r"count = \(47,\); allowed: \(48,\), as the arrays are"),
        ({"poses": 0}, "poses = 0; allowed: what"),
        ({"chunk": 0}, "chunk = 0; allowed: what"),
        ({"chunk": 3}, "chunk = 3; allowed: 6, as the arrays are"),
        ({"shape": [64]}, r"shape = \[64\]; allowed: what"),
        ({"shape": [32, 16]}, r"shape = \(48, 32, 16\); allowed: \(48, 32, 32\), as the arrays are"),
        ({"labels": None}, "labels = None; allowed: what"),
        ({"labels": ["depth"]}, r"labels = \['depth'\]; allowed: what"),
        ({"classes": "all"}, "classes = 'all'; allowed: what"),
        ({"robot": []}, r"robot = \[\]; allowed: what"),
        ({"seed": "a"}, "seed = 'a'; allowed: what"),
        ({"layout": None}, "layout = None; allowed: what"),
        ({"domain": {"x": {"low": 0.0}}}, r"domain.x = .*; allowed: what"),
    ],
)
def test_manifests_that_say_what_cannot_be_are_one_line(
    small: Path, tmp_path: Path, changes: dict[str, object], said: str
) -> None:
    there = shutil.copytree(small, tmp_path / "there")
    manifest = json.loads((there / "manifest.json").read_text()) | changes
    (there / "manifest.json").write_text(json.dumps({n: v for n, v in manifest.items() if v is not None}))
    with pytest.raises(InputError, match=f"manifest.json: .*{said}"):
        open_dataset(there).images([0])


@pytest.mark.parametrize(
    ("table", "changes", "said"),
    [
        ("optics", {"pixel": None}, "optics.pixel = None"),
        ("optics", {"wavelength": "red"}, "optics.wavelength = 'red'"),
        ("optics", {"zernike": None}, "optics.zernike = None"),
        ("optics", {"zernike": {"coma": 0.1}}, "optics.zernike = {'coma': 0.1}"),
        ("optics", {"lens": 1}, "optics.lens is unknown"),
        ("sensor", {"bits": None}, "sensor.bits = None"),
        ("symmetry", {"flip": None}, "symmetry.flip = None"),
        ("robot", {"spheres": None}, "robot.spheres = None"),
        ("robot", {"spheres": [{"center": [0, 0], "radius": 1, "index": 1.5}]}, r"robot.spheres = \[.*"),
        ("robot", {"spheres": []}, "robot has no solids"),
        ("layout", {"depth": [1]}, r"layout.depth = \[1\]"),
        ("rendering", {"speed": 2}, "rendering.speed is unknown"),
    ],
)
def test_tables_of_manifests_that_lack_what_is_read_are_one_line(
    small: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], table: str, changes: dict[str, object], said: str
) -> None:
    there = shutil.copytree(small, tmp_path / "there")
    file = there / "manifest.json"
    manifest = json.loads(file.read_text())
    manifest[table] = {n: v for n, v in (manifest[table] | changes).items() if v is not None}
    file.write_text(json.dumps(manifest))
    with pytest.raises(InputError, match=rf"^{file}: {said}; allowed: what otwarp vision dataset wrote$"):
        open_dataset(there)
    assert main(["vision", "train", str(there), "-o", str(tmp_path / "run")]) == 2
    assert capfd.readouterr().err.startswith(f"otwarp: {file}: ")


@pytest.mark.parametrize("lost", ["data.zarr", "data.zarr/images", "data.zarr/depth", "data.zarr/images/c/0"])
def test_what_is_lost_is_named(small: Path, begun: Path, tmp_path: Path, lost: str) -> None:
    """Of a data set that is whole, and of one that is not, before anything is rendered."""
    for folder in (small, begun):
        there = shutil.copytree(folder, tmp_path / folder.parent.name)
        shutil.rmtree(there / lost)
        with pytest.raises(InputError, match=rf"{lost}.*: is not there; allowed: the file that was written"):
            make_dataset(small.parent / "small.toml", there, device="cpu")


@pytest.mark.parametrize("text", ["", "{", "{}", "[]", "5"])
@pytest.mark.parametrize("name", ["images", "depth"])
def test_a_damaged_description_of_an_array_is_named(
    small: Path, begun: Path, tmp_path: Path, name: str, text: str
) -> None:
    there = shutil.copytree(begun, tmp_path / "there")
    (there / "data.zarr" / name / "zarr.json").write_text(text)
    with pytest.raises(
        InputError, match=rf"{name}/zarr.json: cannot be read \(.*; allowed: the file that was"
    ) as error:
        make_dataset(small.parent / "small.toml", there, device="cpu")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", ["", "{", "{}", "[]"])
def test_a_damaged_marker_is_named(small: Path, begun: Path, tmp_path: Path, text: str) -> None:
    there = shutil.copytree(begun, tmp_path / "there")
    (there / "done" / "000000").write_text(text)
    with pytest.raises(InputError, match=r"done/000000: .*; allowed: what otwarp vision dataset wrote"):
        make_dataset(small.parent / "small.toml", there, device="cpu")


def test_folders_that_hold_something_else_are_refused(small: Path, tmp_path: Path) -> None:
    other = written(tmp_path, TEXT.replace("seed = 3", "seed = 4"))
    with pytest.raises(InputError, match="holds a data set with another seed: 3 there, 4 now"):
        make_dataset(other, small, device="cpu")
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match="which holds other files"):
        make_dataset(other, tmp_path, device="cpu")
    with pytest.raises(InputError, match="holds no data set"):
        open_dataset(tmp_path)
    (tmp_path / "manifest.json").write_text('{"version": 0}')
    with pytest.raises(InputError, match="version = 0; allowed: 1"):
        open_dataset(tmp_path)


def test_rows_that_are_not_there_are_refused(small: Path) -> None:
    found = open_dataset(small)
    for rows, what in (([48], "image is 48"), ([-49], "image is -49"), ([0.5], "float64")):
        with pytest.raises(InputError, match=what):
            found.images(np.array(rows))
    assert found.images([]).shape == (0, 32, 32)
    assert np.array_equal(found.images(found.labels["pose"] == 2), found.images(slice(18, 30)))
    with pytest.raises(InputError, match=r"split is 'other'; allowed in .*: random, focus_blocks, unseen_tilts"):
        found.split("other")


@pytest.mark.quick
@pytest.mark.parametrize("name", ["smoke", "paper", "shifted"])
def test_shipped_files_can_be_rendered(name: str) -> None:
    labels = labels_of(load_spec(SHIPPED / f"{name}.toml"))
    counts = {"smoke": 200, "paper": 19 * 300 + 18 * 50, "shifted": 3 * 19 * 10}
    assert labels.count == counts[name]
    if name == "paper":
        part, kind = labels.arrays["split_random"], labels.arrays["tilt_class"]
        assert [np.bincount(part[kind == c] + 1, minlength=4).tolist() for c in range(19)] == 19 * [[0, 200, 50, 50]]
        assert np.bincount(kind[kind >= 0]).tolist() == 19 * [300]
