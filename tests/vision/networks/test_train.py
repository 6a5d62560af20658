"""Training: it learns, goes on after a kill to the bit, and refuses what cannot be without losing anything."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from otwarp.cli.main import main
from otwarp.errors import InputError
from otwarp.vision.networks import checkpoint, train
from otwarp.vision.networks.evaluate import evaluate
from otwarp.vision.networks.prepare import Training
from otwarp.vision.networks.settings import Settings
from tests.full_disk import largest_file
from tests.vision.networks.conftest import TRAINED

QUICK = {"net": "small", "heads": "both", "epochs": 3, "batch": 16, "images": 32, "size": 32}
"""Of trainings whose result does not matter."""


@pytest.mark.quick
@pytest.mark.skipif(sys.platform != "linux", reason="needs RLIMIT_FSIZE")
def test_a_full_disk_is_said_and_the_last_checkpoint_stays(tmp_path: Path) -> None:
    """torch's writer says of a full disk that a position is unexpected."""
    torch = pytest.importorskip("torch")
    file = tmp_path / "checkpoint.pt"
    checkpoint.save(file, {"version": checkpoint.VERSION, "weights": torch.ones(10)})
    with largest_file(100_000), pytest.raises(OSError, match="File too large") as error:
        checkpoint.save(file, {"version": checkpoint.VERSION, "weights": torch.zeros(100_000)})
    assert error.value.filename == str(file)
    assert list(tmp_path.iterdir()) == [file]
    assert bool(torch.all(checkpoint.load(file, "it")["weights"] == 1.0))


@pytest.mark.quick
def test_a_flipped_bit_of_a_checkpoint_is_seen(tmp_path: Path) -> None:
    """torch itself compares no checksums."""
    torch = pytest.importorskip("torch")
    file = tmp_path / "checkpoint.pt"
    checkpoint.save(file, {"version": checkpoint.VERSION, "weights": torch.full((10_000,), 1.5)})
    damaged = bytearray(file.read_bytes())
    damaged[damaged.index(bytes(torch.full((100,), 1.5).numpy().tobytes())) + 400] ^= 1
    file.write_bytes(damaged)
    with pytest.raises(InputError, match=r"checkpoint\.pt: is damaged, the checksum of .* differs; allowed: it"):
        checkpoint.load(file, "it")


@pytest.mark.quick
def test_a_network_beats_the_baseline_on_blocks_of_focus_that_it_has_not_seen(smoke: Path, trained: Path) -> None:
    _, (found,) = evaluate(trained, [smoke], poses=0, device="cpu")
    template = found.baselines["nearest template"]
    assert found.about == "test part of split focus_blocks" and found.scores["images"] == 25
    for name in ("x", "y", "depth", "tilt"):
        assert found.scores["rmse"][name] < template["rmse"][name], name
    assert found.scores["rmse"]["tilt"] < 0.5 * found.baselines["focus measures, ridge"]["rmse"]["tilt"]
    metrics = checkpoint.read_json(trained / "metrics.json")
    assert metrics["weights"] == {"source": "none"} and metrics["images"] == {"train": 95, "validation": 20, "test": 25}
    assert metrics["test"]["rmse"]["tilt"] == pytest.approx(found.scores["rmse"]["tilt"], rel=1e-3)
    assert len((trained / "curves.csv").read_text().splitlines()) == 31
    assert {p.name for p in trained.iterdir()} == {
        "run.json", "checkpoint.pt", "network.pt", "curves.csv", "curves.json", "curves.png", "metrics.json"
    }  # fmt: skip


def weights(folder: Path) -> dict[str, Any]:
    found = checkpoint.load(folder / checkpoint.NETWORK, "a network")
    return {**found["state"], "widen": np.array(found["about"]["widen"])}


def same(one: dict[str, Any], other: dict[str, Any]) -> bool:
    """Bit for bit."""
    return one.keys() == other.keys() and all(
        np.array_equal(np.asarray(v), np.asarray(other[k])) for k, v in one.items()
    )


def command(smoke: Path, out: Path, epochs: int = 4) -> list[str]:
    options = ["--net", "small", "--epochs", str(epochs), "--batch", "16", "--images", "32", "--size", "32"]
    return [
        sys.executable,
        "-m",
        "otwarp",
        "vision",
        "train",
        str(smoke),
        "--out",
        str(out),
        "--device",
        "cpu",
        *options,
    ]


def test_a_killed_training_goes_on_to_the_same_bits(smoke: Path, tmp_path: Path) -> None:
    subprocess.run(command(smoke, tmp_path / "whole"), check=True, capture_output=True)
    with subprocess.Popen(command(smoke, tmp_path / "killed"), stderr=subprocess.PIPE, text=True) as run:
        assert run.stderr is not None
        for line in run.stderr:
            if "epoch 2 of 4" in line:
                run.kill()
                break
    assert not (tmp_path / "killed" / "metrics.json").exists()
    done = subprocess.run(command(smoke, tmp_path / "killed"), check=True, capture_output=True, text=True)
    assert "epoch 1 of" not in done.stderr and "epoch 4 of 4" in done.stderr
    assert same(weights(tmp_path / "whole"), weights(tmp_path / "killed"))
    columns = ("training_loss", "validation_loss", "accuracy", "depth_rmse_um")
    one, other = (json.loads((tmp_path / n / "curves.json").read_text()) for n in ("whole", "killed"))
    assert [[row[c] for c in columns] for row in one] == [[row[c] for c in columns] for row in other]


def test_what_takes_long_is_done_seldom(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [0.0]
    monkeypatch.setattr(checkpoint.time, "monotonic", lambda: clock[0])
    seldom, done = checkpoint.Seldom(), []
    for _ in range(1000):
        clock[0] += 1.0
        with seldom.if_due() as due:
            if due:
                done.append(clock[0])
                clock[0] += 5.0
    assert 5.0 * len(done) / clock[0] == pytest.approx(0.1, abs=0.01)


def test_a_training_that_is_over_is_not_taken_up_again(smoke: Path, trained: Path) -> None:
    was = (trained / "network.pt").read_bytes()
    rows: list[Any] = []
    train.train(smoke, trained, TRAINED, device="cpu", report=rows.append)
    assert rows == [] and (trained / "network.pt").read_bytes() == was
    with pytest.raises(InputError, match=r"another batch: 4 there, 16 now; allowed"):
        train.train(smoke, trained, dataclasses.replace(TRAINED, batch=16))


def test_a_loss_that_is_no_number_stops_and_keeps_the_last_checkpoint(smoke: Path, tmp_path: Path, monkeypatch) -> None:
    step = train.one_step

    def bad(work: Training, *rest: Any) -> Any:
        loss = step(work, *rest)
        return loss * float("nan") if len(work.rows) == 2 else loss

    with monkeypatch.context() as patch:
        patch.setattr(train, "one_step", bad)
        patch.setattr(checkpoint.Seldom, "SHARE", 1.0)
        with pytest.raises(
            InputError, match=r"the loss became nan in epoch 3, step 1, at lr 0.001; .*of epoch 2 is kept"
        ):
            train.train(smoke, tmp_path / "out", Settings(**QUICK), device="cpu")
    kept = checkpoint.load(tmp_path / "out" / "checkpoint.pt", "")
    assert [row["epoch"] for row in kept["rows"]] == [1, 2]
    whole = train.train(smoke, tmp_path / "out", Settings(**QUICK), device="cpu")
    assert whole == train.train(smoke, tmp_path / "out", Settings(**QUICK), device="cpu")


def test_a_last_step_that_spoils_the_weights_is_no_checkpoint(smoke: Path, tmp_path: Path, monkeypatch) -> None:
    """The loss of a step is that before it: of the last step of an epoch only the validation part tells."""
    step = train.one_step

    def spoils(work: Training, *rest: Any) -> Any:
        loss = step(work, *rest)
        if len(work.rows) == 1:
            for parameter in work.network.parameters():
                parameter.data.fill_(float("inf"))
        return loss

    monkeypatch.setattr(train, "one_step", spoils)
    monkeypatch.setattr(checkpoint.Seldom, "SHARE", 1.0)
    quick = Settings(**{**QUICK, "batch": 32})
    with pytest.raises(InputError, match=r"the loss became nan in epoch 2, step 1, .*of epoch 1 is kept"):
        train.train(smoke, tmp_path / "out", quick, device="cpu")
    assert [row["epoch"] for row in checkpoint.load(tmp_path / "out" / "checkpoint.pt", "")["rows"]] == [1]


def test_a_batch_that_does_not_fit_is_named(smoke: Path, tmp_path: Path, monkeypatch) -> None:
    import torch

    def full(*_: Any) -> Any:
        raise torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2.00 GiB.")

    monkeypatch.setattr(train, "one_step", full)
    with pytest.raises(InputError, match=r"batch is 16, which does not fit the memory of cpu .*allowed: a smaller one"):
        train.train(smoke, tmp_path / "out", Settings(**QUICK), device="cpu")


def test_half_precision_begins_as_single_does(smoke: Path, tmp_path: Path) -> None:
    losses = []
    for precision in ("float32", "bf16"):
        train.train(
            smoke, tmp_path / precision, Settings(**{**QUICK, "precision": precision, "epochs": 1}), device="cpu"
        )
        losses.append(json.loads((tmp_path / precision / "curves.json").read_text())[0]["training_loss"])
    assert losses[1] == pytest.approx(losses[0], rel=0.05)  # eight bits of every activation


@pytest.mark.quick
@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"net": "alexnet"}, "net is 'alexnet'"),
        ({"epochs": 0}, "epochs is 0"),
        ({"size": 16}, "size is 16"),
        ({"lr": 2.0}, "lr is 2"),
        ({"net": "small", "weights": "imagenet"}, "weights is imagenet"),
    ],
)
def test_settings_that_cannot_be(settings: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        Settings(**settings)
    assert "allowed" in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"split": "unseen_robots"}, "split is 'unseen_robots'"),
        ({"images": 500}, "images is 500; allowed: up to 130"),
        ({"weights": "absent.pth"}, "--weights is absent.pth"),
        ({"net": "resnet18", "weights": "imagenet"}, "resnet18-f37072fd.pth is not there"),
    ],
)
def test_bad_input_leaves_nothing(smoke: Path, tmp_path: Path, monkeypatch, changes: dict[str, Any], said: str) -> None:
    monkeypatch.setenv("TORCH_HOME", str(tmp_path / "cache"))
    with pytest.raises(InputError, match=said) as caught:
        train.train(smoke, tmp_path / "out", Settings(**{**QUICK, **changes}), device="cpu")
    assert "allowed" in str(caught.value) and not (tmp_path / "out").exists()


def test_places_may_be_texts(smoke: Path, tmp_path: Path) -> None:
    settings = Settings(**{**QUICK, "epochs": 1, "images": 8, "batch": 8})
    train.train(str(smoke), str(tmp_path / "out"), settings, device="cpu")
    assert (tmp_path / "out" / "network.pt").is_file()


def test_weights_are_those_that_were_asked_for(smoke: Path, tmp_path: Path, monkeypatch) -> None:
    import torch

    from otwarp.vision.networks.modules.resnet import resnet18

    torch.manual_seed(3)
    state = resnet18().state_dict()
    torch.save(state, file := tmp_path / "own.pth")
    quick = Settings(**{**QUICK, "net": "resnet18", "weights": str(file), "epochs": 1, "batch": 32})
    found = train.train(smoke, tmp_path / "out", quick, device="cpu")
    assert found["weights"]["source"] == "file" and found["weights"]["file"] == "own.pth"
    # of the unused layer nothing is trained: it is still as it was in the file
    assert torch.equal(
        checkpoint.load(tmp_path / "out" / "network.pt", "")["state"]["backbone.fc.weight"], state["fc.weight"]
    )
    other = Settings(**{**QUICK, "net": "resnet50", "weights": str(file)})
    with pytest.raises(InputError, match=r"own.pth: weights of another network than resnet50: .*allowed: shape"):
        train.train(smoke, tmp_path / "other", other, device="cpu")
    # a file of the right name with other bytes is not taken for the published one
    monkeypatch.setenv("TORCH_HOME", str(tmp_path))
    (tmp_path / "hub" / "checkpoints").mkdir(parents=True)
    file.rename(tmp_path / "hub" / "checkpoints" / "resnet18-f37072fd.pth")
    with pytest.raises(InputError, match="is damaged"):
        train.train(smoke, tmp_path / "third", Settings(**{**QUICK, "net": "resnet18", "weights": "imagenet"}))
    assert not (tmp_path / "other").exists() and not (tmp_path / "third").exists()


def test_heads_of_the_paper_are_evaluated(smoke: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """They say tilts and normalised depth, no pose, though poses vary in the images."""
    assert main([*command(smoke, tmp_path / "out", epochs=1)[3:], "--heads", "paper"]) == 0
    assert main(["vision", "evaluate", str(tmp_path / "out"), str(smoke), "--poses", "1", "--device", "cpu"]) == 0
    said = capfd.readouterr().out
    assert "% of tilts right, normalised depth" in said and "µm" not in said
    page = (tmp_path / "out" / "report" / "report.md").read_text(encoding="utf-8")
    assert "| network |" in page and "by tilt" not in page and "Cramér" not in page


@pytest.mark.quick
@pytest.mark.parametrize(
    ("given", "folder"), [(".", "set_small"), ("..", "above_small"), ("in", "in_small"), ("/", "_small")]
)
def test_the_folder_of_a_training_has_the_name_of_its_data_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], given: str, folder: str
) -> None:
    """Also where that is where one is, which is no name."""
    asked: list[Path] = []

    def run(dataset: Path, folder: Path, *_: object, **__: object) -> None:
        asked.append(folder)
        raise InputError("no training here")

    there = tmp_path / "above" / "set"
    there.mkdir(parents=True)
    monkeypatch.chdir(there)
    monkeypatch.setattr("otwarp.vision.networks.train.train", run)
    assert main(["vision", "train", given, "--net", "small"]) == 2
    assert capfd.readouterr().err == "otwarp: no training here\n"
    assert [one.name for one in asked] == [folder]


def test_the_command_says_what_it_reached(smoke: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    words = command(smoke, tmp_path / "out", epochs=1)[3:]
    assert main(words) == 0
    out, error = capfd.readouterr()
    assert "small from random weights, epoch 1, 35 test images" in out and "epoch 1 of 1: loss" in error
    assert main(["vision", "evaluate", str(tmp_path / "out"), str(smoke), "--poses", "1", "--device", "cpu"]) == 0
    assert (tmp_path / "out" / "report" / "report.md").is_file()
    # a file of the training stands for it; what cannot be written is refused before anything is looked at
    network = str(tmp_path / "out" / "network.pt")
    assert main(["vision", "export", network]) == 0 and (tmp_path / "out" / "robot.onnx").is_file()
    capfd.readouterr()
    assert main(["vision", "evaluate", network, str(smoke), "--report", "/proc/x", "--device", "cpu"]) == 2
    assert "smoke" not in capfd.readouterr().err
