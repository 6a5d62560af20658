"""A data set of 200 images, rendered once, and a small network that learnt from it."""

from __future__ import annotations

from pathlib import Path

import pytest

from otwarp.vision.networks.settings import Settings
from tests.documents import ROOT

TRAINED = Settings(net="small", split="focus_blocks", epochs=30, batch=4, lr=2e-3, seed=1)
"""How the network of these tests is trained."""


@pytest.fixture(scope="session")
def smoke(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`vision/smoke.toml`, rendered."""
    pytest.importorskip("torch")
    pytest.importorskip("zarr")
    from otwarp.vision.datasets import labels_of, load_spec, make_dataset

    folder = tmp_path_factory.mktemp("vision") / "smoke"
    make_dataset(labels_of(load_spec(ROOT / "vision" / "smoke.toml")), folder, processes=1, device="cpu")
    return folder


@pytest.fixture(scope="session")
def trained(smoke: Path) -> Path:
    """The small network, trained on blocks of the focus sweep."""
    from otwarp.vision.networks.train import train

    folder = smoke.with_name("small")
    train(smoke, folder, TRAINED, device="cpu")
    return folder
