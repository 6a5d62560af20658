"""torchvision's own networks beside ours: files of their weights load, and give the same numbers."""

from __future__ import annotations

from pathlib import Path

import pytest

torch = pytest.importorskip("torch")
models = pytest.importorskip("torchvision.models", reason="torchvision is not installed with its torch")

from otwarp.vision.networks.modules.network import BACKBONES  # noqa: E402
from otwarp.vision.networks.weights import load_weights  # noqa: E402


@pytest.mark.parametrize("net", ["resnet18", "resnet50", "vgg16"])
def test_a_file_of_torchvision_gives_its_features_and_logits(net: str, tmp_path: Path) -> None:
    """Weights and running statistics drawn at random; bit for bit."""
    torch.manual_seed(0)
    theirs = getattr(models, net)(weights=None).eval()
    for module in theirs.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            torch.nn.init.normal_(module.running_mean, 0.0, 0.1)
            torch.nn.init.uniform_(module.running_var, 0.5, 2.0)
            torch.nn.init.uniform_(module.weight, 0.5, 1.5)
            torch.nn.init.normal_(module.bias, 0.0, 0.1)
    file = tmp_path / "weights.pth"
    torch.save(theirs.state_dict(), file)
    ours = BACKBONES[net]().eval()
    assert load_weights(ours, net, str(file))["source"] == "file"
    images = torch.randn(2, 3, 224, 224)
    with torch.no_grad():
        # what comes before the pooling is all but its last layers
        body = theirs.features if net == "vgg16" else torch.nn.Sequential(*list(theirs.children())[:-2])
        assert torch.equal(ours.maps(images), body(images))
        assert torch.equal(ours(images), theirs(images))
