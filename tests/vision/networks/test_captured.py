"""Captured steps take the same way as steps by themselves, and go on after an interruption to the bit."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pytest

from otwarp.vision.networks import train
from otwarp.vision.networks.captured import CapturedNetwork, CapturedSteps, set_rate
from otwarp.vision.networks.settings import Settings

QUICK = Settings(net="small", split="focus_blocks", epochs=3, batch=16, lr=1e-3, seed=3)


@pytest.fixture(autouse=True)
def gpu(device: str) -> None:
    if not device.startswith("cuda"):
        pytest.skip("graphs are captured on a GPU: run with --device cuda:0")


def losses(smoke: Path, folder: Path, device: str, settings: Settings = QUICK) -> list[float]:
    rows = []
    train.train(smoke, folder, settings, device=device, report=rows.append)
    return [row["training_loss"] for row in rows]


def test_they_take_the_same_way(smoke: Path, tmp_path: Path, device: str, monkeypatch: pytest.MonkeyPatch) -> None:
    captured = losses(smoke, tmp_path / "captured", device)
    monkeypatch.setattr(train, "steps_of", lambda work: functools.partial(train.one_step, work))
    alone = losses(smoke, tmp_path / "alone", device)
    # the optimiser corrects its bias on the device, in float32
    np.testing.assert_allclose(captured, alone, rtol=1e-3)


def test_they_go_on_to_the_bit(smoke: Path, tmp_path: Path, device: str) -> None:
    class Stop(Exception):
        pass

    def stop(row: object) -> None:
        raise Stop

    whole = losses(smoke, tmp_path / "whole", device)
    with pytest.raises(Stop):
        train.train(smoke, tmp_path / "parts", QUICK, device=device, report=stop)
    assert losses(smoke, tmp_path / "parts", device) == whole[1:]


@pytest.mark.parametrize("last", [False, True], ids=["its GPU", "another GPU than the current one"])
def test_capturing_changes_nothing(device: str, last: bool) -> None:
    import torch

    if last:
        if torch.cuda.device_count() < 2:
            pytest.skip("there is one GPU: none is another than the current one")
        device = f"cuda:{torch.cuda.device_count() - 1}"
    torch.manual_seed(0)
    network = torch.nn.Sequential(torch.nn.Linear(4, 8), torch.nn.BatchNorm1d(8), torch.nn.Linear(8, 1)).to(device)
    optimiser = torch.optim.Adam(network.parameters(), lr=1e-2, fused=True)
    random = torch.Generator(device).manual_seed(5)
    data = torch.randn(64, 4, device=device)

    def step(batch: torch.Tensor, share: torch.Tensor) -> torch.Tensor:
        noise = torch.randn(len(batch), 4, generator=random, device=device)
        loss = (network(data[batch] + noise) ** 2).mean() * (1.0 + share)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        optimiser.step()
        return loss.detach()

    steps = CapturedSteps(step, network, optimiser, random)
    before = [p.clone() for p in network.state_dict().values()]
    steps._captured(torch.arange(16, device=device))
    assert all(torch.equal(a, b) for a, b in zip(before, network.state_dict().values(), strict=True))
    set_rate(optimiser, 0.0)
    some = torch.arange(16, device=device)
    assert float(steps(some, 0.0)) != float(steps(some, 0.0)), "the noise of another step"
    weights = network[0].weight.clone()
    set_rate(optimiser, 1e-2)
    steps(some, 1.0)
    assert not torch.equal(weights, network[0].weight)


def test_a_captured_network_says_what_it_says(device: str) -> None:
    """For each number of images, again and again, on each GPU that there is and whichever is the current one."""
    import torch

    from otwarp.vision.networks.modules.network import Network

    for place in {device, f"cuda:{torch.cuda.device_count() - 1}"}:
        torch.manual_seed(0)
        network = Network("small", classes=3, names=("x", "y"), offset=torch.zeros(2), scale=torch.ones(2)).eval()
        network = network.to(place).to(memory_format=torch.channels_last)
        captured = CapturedNetwork(lambda images, seen=network: seen(images.float() / 255.0))
        with torch.inference_mode():
            for count in (1, 3, 1):
                images = torch.randint(0, 256, (count, 48, 48), dtype=torch.uint8, device=place)
                plain, said = network(images.float() / 255.0), captured(images)
                assert said.keys() == plain.keys()
                for name, value in said.items():
                    torch.testing.assert_close(value, plain[name], rtol=1e-4, atol=1e-4)
        assert set(captured.graphs) == {1, 3}


@pytest.mark.parametrize("mirrored", [False, True])
def test_poses_of_a_yaw_are_captured(device: str, mirrored: bool) -> None:
    import torch

    from otwarp.vision.networks.modules.loss import residuals

    names = ("tilt", "yaw", "depth")
    mean, truth = torch.rand(2, 5, 3, device=device, generator=torch.Generator(device).manual_seed(2))
    scale = torch.ones(3, device=device)
    alone = residuals(mean, 9.0 * truth, scale, names, mirrored=mirrored)
    graph = torch.cuda.CUDAGraph()
    with torch.cuda.graph(graph):
        captured = residuals(mean, 9.0 * truth, scale, names, mirrored=mirrored)
    graph.replay()
    torch.testing.assert_close(captured, alone, rtol=0.0, atol=0.0)
