"""A trained network in use: estimates, evaluation, and the same numbers from an exported file."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.vision.datasets import Robot, open_dataset
from otwarp.vision.networks import Estimate, load
from otwarp.vision.networks.evaluate import check_fits, evaluate
from otwarp.vision.networks.learnt import check_robot, exceeded
from otwarp.vision.networks.onnx_file import export
from otwarp.vision.networks.report import write_report
from otwarp.vision.networks.run import TorchEstimator
from tests.full_disk import largest_file


def test_estimates_are_near_the_truth_and_say_how_near(smoke: Path, trained: Path) -> None:
    network, data = load(trained, device="cpu"), open_dataset(smoke)
    assert network.shape == (64, 64) and network.pixel == 0.125
    rows = data.split("focus_blocks")["train"]
    found = network.estimate(data.images(rows))
    assert len(found) == len(rows) and isinstance(found[0], Estimate)
    assert found[0].known == ("x", "y", "depth", "tilt")
    assert found[0].yaw == 0.0 and found[0].covariance[4, 4] == np.inf and np.all(found[0].covariance[4, :4] == 0.0)
    away = np.array([e.depth for e in found]) - data.labels["depth"][rows]
    sigma = np.sqrt([e.covariance[2, 2] for e in found])
    # a network of 30 epochs: better than the sweep's spread of 2.3 µm, and not sure of nonsense
    assert np.sqrt(np.mean(away**2)) < 1.0 and np.mean((away / sigma) ** 2) < 4.0
    for estimate in found:
        assert np.all(np.linalg.eigvalsh(estimate.covariance[:4, :4]) > 0.0)
    assert np.allclose(network.estimate(data.images(rows[:1])[0])[0].mean, found[0].mean, atol=1e-4)


def test_exported_networks_say_the_same(smoke: Path, trained: Path, tmp_path: Path) -> None:
    pytest.importorskip("onnx")
    pytest.importorskip("onnxruntime")
    assert export(trained, tmp_path / "robot.onnx") == ("scores", "depth", "mean", "covariance")
    images = open_dataset(smoke).images(np.arange(0, 200, 23))
    one, other = load(trained, device="cpu"), load(tmp_path / "robot.onnx")
    said, again = one.predict(images), other.predict(images)
    for name in ("scores", "depth", "mean"):
        assert np.allclose(getattr(said, name), getattr(again, name), atol=1e-3), name
    assert said.covariance is not None and again.covariance is not None
    assert np.allclose(said.covariance, again.covariance, rtol=1e-2, atol=1e-5)
    assert [e.known for e in other.estimate(images)] == [e.known for e in one.estimate(images)]
    assert other.about["net"] == "small" and other.shape == (64, 64)
    with pytest.raises(InputError, match=r"--onnx is .*robot.pb; allowed"):
        export(trained, tmp_path / "robot.pb")
    (tmp_path / "bad.onnx").write_bytes(b"no network")
    with pytest.raises(InputError, match=r"bad.onnx: cannot be read .*allowed"):
        load(tmp_path / "bad.onnx")


def test_threads_change_no_bit_where_their_number_is_given(smoke: Path, trained: Path) -> None:
    """As for closed loops, whose recordings are replayed in a process that has other threads."""
    import torch

    images, before, said = open_dataset(smoke).images(np.arange(0, 200, 50)), torch.get_num_threads(), []
    try:
        for threads in (1, 2):
            torch.set_num_threads(threads)
            said.append(load(trained, device="cpu", threads=1).predict(images))
            assert torch.get_num_threads() == threads
    finally:
        torch.set_num_threads(before)
    for name in ("scores", "depth", "mean", "covariance"):
        assert getattr(said[0], name).tobytes() == getattr(said[1], name).tobytes(), name


@pytest.mark.parametrize("threads", [-1, 1025, 10**6, 1.5, True, "2"])
def test_numbers_of_threads_that_cannot_be_are_refused(tmp_path: Path, threads: object) -> None:
    for name in ("run", "robot.onnx"):
        with pytest.raises(InputError, match=f"threads is {threads!r}; allowed: a whole number, 0 to 1024"):
            load(tmp_path / name, threads=threads)  # type: ignore[arg-type]


def test_no_images_give_no_estimates(smoke: Path, trained: Path, tmp_path: Path) -> None:
    pytest.importorskip("onnxruntime")
    export(str(trained), str(tmp_path / "robot.onnx"))
    none = open_dataset(smoke).images([])
    for path in (trained, tmp_path / "robot.onnx"):
        network = load(path, device="cpu")
        assert network.estimate(none) == []
        said = network.predict(none)
        assert said.scores is not None and said.scores.shape == (0, 5)
        assert said.covariance is not None and said.covariance.shape == (0, 4, 4)


@pytest.mark.parametrize("name", ["net.pt", "net.onnx"])
def test_the_folder_of_a_training_may_be_called_as_a_file(trained: Path, tmp_path: Path, name: str) -> None:
    pytest.importorskip("onnx")
    there = shutil.copytree(trained, tmp_path / name)
    assert load(there, device="cpu").about["net"] == "small"
    assert main(["vision", "export", str(there)]) == 0 and (there / "robot.onnx").is_file()


def test_files_that_are_no_networks_are_one_line(trained: Path, tmp_path: Path) -> None:
    """A checkpoint beside the network, and an ONNX file whose metadata another program has replaced."""
    onnx = pytest.importorskip("onnx")
    pytest.importorskip("onnxruntime")
    with pytest.raises(InputError, match=r"checkpoint.pt: does not say net of its network; allowed: network.pt"):
        load(trained / "checkpoint.pt", device="cpu")
    export(trained, tmp_path / "robot.onnx")
    model = onnx.load(tmp_path / "robot.onnx")
    about, checksum = model.metadata_props
    model.metadata_props.remove(checksum)
    about.value = json.dumps({"net": "small"})
    onnx.save(model, tmp_path / "robot.onnx")
    with pytest.raises(InputError, match=r"robot.onnx: does not say heads of its network; allowed"):
        load(tmp_path / "robot.onnx")


def test_an_exported_network_that_has_changed_is_refused_in_one_line(trained: Path, tmp_path: Path) -> None:
    """A bit of a weight, of the checksum, or a number that another program wrote; a file of old has no checksum."""
    onnx = pytest.importorskip("onnx")
    pytest.importorskip("onnxruntime")
    file = tmp_path / "robot.onnx"
    export(trained, file)
    whole, model = file.read_bytes(), onnx.load(file)
    weight = whole.index(model.graph.initializer[0].raw_data) + 5
    other = onnx.load(file)
    other.producer_name = "another program"
    changed = [other.SerializeToString()]
    for place in (weight, len(whole) - 1):
        changed.append(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
    for data in changed:
        file.write_bytes(data)
        with pytest.raises(InputError, match=r"robot.onnx: is damaged, or another program has changed it") as error:
            load(file)
        assert "\n" not in str(error.value)
    assert [entry.key for entry in model.metadata_props] == ["otwarp", "otwarp_sha256"]
    del model.metadata_props[1]
    onnx.save(model, file)
    assert load(file).about["net"] == "small"


def test_images_are_resized_alike_by_torch_and_in_the_file(smoke: Path, tmp_path: Path) -> None:
    pytest.importorskip("onnxruntime")
    from otwarp.vision.networks.settings import Settings
    from otwarp.vision.networks.train import train

    settings = Settings(net="small", heads="pose", epochs=1, images=32, size=40)
    train(smoke, tmp_path / "run", settings, device="cpu")
    export(tmp_path / "run", tmp_path / "robot.onnx")
    images = open_dataset(smoke).images(slice(0, 5))
    said = [load(path).predict(images) for path in (tmp_path / "run", tmp_path / "robot.onnx")]
    assert said[0].scores is None and said[0].mean is not None and said[1].mean is not None
    assert np.allclose(said[0].mean, said[1].mean, atol=1e-3)


def test_evaluation_makes_a_page_with_figures(smoke: Path, trained: Path, tmp_path: Path) -> None:
    other = shutil.copytree(smoke, tmp_path / "copy")
    manifest = json.loads((other / "manifest.json").read_text())
    (other / "manifest.json").write_text(json.dumps({**manifest, "seed": 99}))
    estimator, found = evaluate(trained, [smoke, other], poses=2, device="cpu")
    assert [one.about for one in found] == ["test part of split focus_blocks", "all images"]
    assert found[1].scores["images"] == 200 and not found[1].baselines
    for one in found[0].efficiency.values():
        assert 0.0 < one["bound"] < one["rmse"] and one["efficiency"] == pytest.approx(one["bound"] / one["rmse"])
    whole, rows = found[0].efficiency["depth"], found[0].by_pose
    assert {row["tilt"] for row in rows} == {0.0, 90.0}
    apart = [row["quantities"]["depth"] for row in rows if "depth" in row["quantities"]]
    for key in ("bound", "rmse"):  # the whole is the root mean square of its parts
        squares = [one["images"] * one[key] ** 2 for one in apart]
        assert np.sum(squares) == pytest.approx(whole["images"] * whole[key] ** 2)
    page = write_report(str(tmp_path / "report"), estimator, found)
    text = page.read_text()
    for words in (
        "nearest template",
        "Cramér–Rao bound",
        "within the 95 % interval",
        "Root mean square error by tilt",
        "by pose and depth",
    ):
        assert words in text
    assert {p.name for p in (tmp_path / "report").iterdir()} == {
        "report.md", "report.json", *(f"{n}_{name}_{kind}.png" for n, name in ((1, "smoke"), (2, "copy"))
                                      for kind in ("confusion", "errors", "calibration")),
    }  # fmt: skip
    said = json.loads((tmp_path / "report" / "report.json").read_text())
    assert np.sum(said["evaluations"][1]["scores"]["confusion"]) == 200


@pytest.mark.parametrize("place", ["", "data.zarr", "data.zarr/images", "../link"])
def test_a_report_is_written_into_no_data_set(
    smoke: Path, trained: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], place: str
) -> None:
    """Its files would lie among those whose checksums are kept."""
    data = shutil.copytree(smoke, tmp_path / "copy")
    (tmp_path / "link").symlink_to(data)
    before = sorted(data.rglob("*"))
    folder = data / place if place else data
    words = ["vision", "evaluate", str(trained), str(smoke), "--report", str(folder), "--device", "cpu"]
    assert main(words) == 2
    said = f"--report is {folder}, which holds a data set; allowed: a folder of its own"
    assert capsys.readouterr().err == f"otwarp: {said}\n"
    with pytest.raises(InputError, match=f"^{said}$"):
        write_report(folder, load(trained, device="cpu"), [])
    assert sorted(data.rglob("*")) == before


@pytest.mark.parametrize("here", [".", "..", "../smoke"])
def test_data_sets_have_the_names_of_their_folders(
    smoke: Path, trained: Path, tmp_path: Path, monkeypatch, capsys: pytest.CaptureFixture[str], here: str
) -> None:
    monkeypatch.chdir(smoke / "data.zarr" if here == ".." else smoke)
    words = ["vision", "evaluate", str(trained), here, "--poses", "0", "--no-baselines", "--device", "cpu"]
    assert main([*words, "--report", str(tmp_path)]) == 0
    out, told = capsys.readouterr()
    assert told == "otwarp: smoke\n" and out.startswith("smoke, test part of split focus_blocks: ")
    assert "## smoke: " in (tmp_path / "report.md").read_text() and (tmp_path / "1_smoke_errors.png").is_file()


@pytest.mark.skipif(sys.platform != "linux", reason="needs RLIMIT_FSIZE")
def test_a_full_disk_changes_no_file_of_a_report(smoke: Path, trained: Path, tmp_path: Path) -> None:
    """Its first file fits, a later one does not."""
    estimator, found = evaluate(trained, [smoke], poses=0, baselines=False, device="cpu")
    folder = write_report(tmp_path / "whole", estimator, found).parent
    first = (folder / "1_smoke_confusion.png").stat().st_size
    assert max(p.stat().st_size for p in folder.iterdir()) > first
    for file in folder.iterdir():
        file.write_bytes(b"of the evaluation before")
    for place in (folder, tmp_path / "new"):
        with largest_file(first), pytest.raises(OSError, match="File too large") as error:
            write_report(place, estimator, found)
        assert Path(error.value.filename).parent == place and Path(error.value.filename).name.startswith(("1_", "rep"))
    assert {p.read_bytes() for p in folder.iterdir()} == {b"of the evaluation before"}
    assert [p.name for p in tmp_path.iterdir()] == ["whole"]


@pytest.mark.parametrize("command", ["evaluate", "find"])
def test_a_full_gpu_is_a_line_that_names_the_batch(
    command: str, smoke: Path, trained: Path, tmp_path: Path, monkeypatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import torch

    def full(*_: object) -> object:
        raise torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2.00 GiB.")

    monkeypatch.setattr(TorchEstimator, "_seen", full)
    np.save(tmp_path / "frame.npy", open_dataset(smoke).images([100])[0])
    asked = {"evaluate": [trained, smoke, "--report", tmp_path / "report"],
             "find": [tmp_path / "frame.npy", "--net", trained, "-o", tmp_path / "found.csv"]}  # fmt: skip
    assert main(["vision", command, *map(str, asked[command]), "--device", "cpu"]) == 2
    batch = {"evaluate": 25, "find": 1}[command]
    assert capsys.readouterr().err.splitlines()[-1] == (
        f"otwarp: batch is {batch}, which does not fit the memory of cpu (CUDA out of memory. Tried to allocate "
        "2.00 GiB.); allowed: --device cpu, or a GPU with more memory that is free"
    )


def test_bounds_that_do_not_fit_are_named(smoke: Path, trained: Path, monkeypatch) -> None:
    def full(*_: object, **__: object) -> object:
        raise RuntimeError("Failed to allocate 1000 bytes on device 'cuda:0'")

    monkeypatch.setattr("otwarp.vision.networks.evaluate.bounds", full)
    with pytest.raises(InputError, match=r"^a pose of the Cramér–Rao bound does not fit .*allowed: poses 0"):
        evaluate(trained, [smoke], baselines=False, device="cpu")


def test_what_does_not_fit_is_refused(smoke: Path, trained: Path, tmp_path: Path) -> None:
    network, data = load(trained, device="cpu"), open_dataset(smoke)
    with pytest.raises(InputError, match=r"images is uint8 \(1, 32, 32\); allowed: uint8 \(n, 64, 64\)"):
        network.estimate(np.zeros((32, 32), dtype=np.uint8))
    with pytest.raises(InputError, match="images is float64"):
        network.estimate(np.zeros((64, 64)))
    data.manifest["classes"] = [0.0, 90.0]
    with pytest.raises(InputError, match=r"smoke: has other classes of tilt: 2, 0° to 90°; allowed: the network's 5"):
        check_fits(network, data, "smoke")
    data.manifest["optics"]["pixel"] = 0.1
    with pytest.raises(InputError, match=r"pixel is 0.1 µm; allowed: 0.125 µm"):
        check_fits(network, data, "smoke")
    with pytest.raises(InputError, match=r"network.pt: is not there; allowed"):
        load(tmp_path)
    (tmp_path / "network.pt").write_bytes((trained / "network.pt").read_bytes()[:5000])
    with pytest.raises(InputError, match=r"network.pt: cannot be read, it is cut short, damaged or of another kind"):
        load(tmp_path)
    with pytest.raises(InputError, match="there is no data set to evaluate on"):
        evaluate(trained, [])
    with pytest.raises(InputError, match=r"run is robot.onnx, an exported network; allowed: the folder of its train"):
        evaluate("robot.onnx", [smoke])


def test_a_network_of_another_robot_or_training_is_refused(smoke: Path, trained: Path, tmp_path: Path) -> None:
    other = shutil.copytree(smoke, tmp_path / "copy")
    manifest = json.loads((other / "manifest.json").read_text())
    manifest["robot"]["spheres"][1]["radius"] += 0.1
    (other / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(
        InputError, match=r"copy: the robot \(a robot of its file, 3 solids, 4.22 µm\) is not that of the"
    ):
        evaluate(trained, [other], poses=0, device="cpu")
    network, data = load(trained, device="cpu"), open_dataset(smoke)
    assert network.about["learnt"]["tilt"] == (0.0, 90.0)
    assert network.about["learnt"]["wavelength"] == (0.55, 0.55)
    assert exceeded(network.about, {"tilt": (5.0, 90.5), "depth": (-3.0, 3.0)}) == []
    found = exceeded(network.about, {"tilt": (-30.0, 5.0), "wavelength": (0.6, 0.6), "yaw": (40.0, 50.0)})
    assert found == ["tilt -30 to 5° (learnt: 0 to 90°)", "wavelength 0.6 µm (learnt: 0.55 µm)",
                     "yaw 40 to 50° (learnt: 0°)"]  # fmt: skip
    check_robot(network.about, Robot.read(data.manifest["robot"]), "smoke")
    # a file that was copied from elsewhere
    moved = shutil.copytree(trained, tmp_path / "moved")
    run = json.loads((moved / "run.json").read_text())
    run["settings"]["seed"] = 99
    (moved / "run.json").write_text(json.dumps(run))
    with pytest.raises(InputError, match=r"network.pt: is not the network of the training in .*run.json; allowed"):
        evaluate(moved, [smoke], poses=0, device="cpu")
    old = {name: value for name, value in network.about.items() if name != "robot"}
    with pytest.raises(InputError, match=r"does not say of which robot it is; allowed: .* or --any-robot"):
        check_robot(old, Robot.read(data.manifest["robot"]), "smoke")


def test_another_robot_may_be_asked_for(smoke: Path, trained: Path, tmp_path: Path) -> None:
    other = shutil.copytree(smoke, tmp_path / "copy")
    manifest = json.loads((other / "manifest.json").read_text())
    manifest["robot"]["spheres"][1]["radius"] += 0.1
    (other / "manifest.json").write_text(json.dumps(manifest))
    _, found = evaluate(trained, [other], poses=0, device="cpu", any_robot=True)
    assert found[0].about == "all images"
