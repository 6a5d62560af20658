"""Captured steps take the same way as steps by themselves, and go on after an interruption to the bit."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pytest

from otwarp.vision.networks import train
from otwarp.vision.networks.captured import CapturedSteps, set_rate
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


def test_capturing_changes_nothing(device: str) -> None:
    import torch

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
