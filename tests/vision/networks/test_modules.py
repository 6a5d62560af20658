"""The networks' names, shapes and sizes, their heads and losses."""

from __future__ import annotations

import math

import numpy as np
import pytest

from otwarp.vision.networks.metrics import pose_scores, widening
from otwarp.vision.networks.predict import covariances

torch = pytest.importorskip("torch")

from otwarp.vision.networks.modules.augment import augmented  # noqa: E402
from otwarp.vision.networks.modules.heads import PoseHead  # noqa: E402
from otwarp.vision.networks.modules.loss import calibrated_loss, paper_loss, pose_loss, residuals  # noqa: E402
from otwarp.vision.networks.modules.network import BACKBONES, Exported, Network  # noqa: E402

ALL = ("x", "y", "depth", "tilt", "yaw")
BLOCK = (
    "conv{}.weight",
    "bn{}.weight",
    "bn{}.bias",
    "bn{}.running_mean",
    "bn{}.running_var",
    "bn{}.num_batches_tracked",
)


def torchvision_names(net: str) -> list[str]:
    """Keys of the weight files that torchvision publishes, as its documentation of the layers has them."""
    if net == "vgg16":
        layers = [f"features.{n}" for n in (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28)]
        layers += [f"classifier.{n}" for n in (0, 3, 6)]
        return [f"{layer}.{part}" for layer in layers for part in ("weight", "bias")]
    counts, convolutions = {"resnet18": ((2, 2, 2, 2), 2), "resnet50": ((3, 4, 6, 3), 3)}[net]
    names = [part.format(1) for part in BLOCK]
    for stage, count in enumerate(counts, start=1):
        for block in range(count):
            place = f"layer{stage}.{block}."
            names += [place + part.format(n) for n in range(1, convolutions + 1) for part in BLOCK]
            if block == 0 and (stage > 1 or net == "resnet50"):
                names.append(f"{place}downsample.0.weight")
                names += [f"{place}downsample.1{part.removeprefix('bn{}')}" for part in BLOCK[1:]]
    return [*names, "fc.weight", "fc.bias"]


@pytest.mark.quick
@pytest.mark.parametrize(
    ("net", "parameters", "tensors"),
    [("vgg16", 138_357_544, 32), ("resnet18", 11_689_512, 122), ("resnet50", 25_557_032, 320)],
)
def test_networks_have_the_names_and_sizes_of_torchvisions(net: str, parameters: int, tensors: int) -> None:
    with torch.device("meta"):  # no weights are drawn
        module = BACKBONES[net]()
    state = module.state_dict()
    assert list(state) == torchvision_names(net) and len(state) == tensors
    assert sum(p.numel() for p in module.parameters()) == parameters
    stem = {"vgg16": "features.0.weight"}.get(net, "conv1.weight")
    assert tuple(state[stem].shape) == ((64, 3, 3, 3) if net == "vgg16" else (64, 3, 7, 7))


def test_the_small_network_takes_a_tenth_of_the_arithmetic() -> None:
    from torch.utils.flop_counter import FlopCounterMode

    found = {}
    for net, channels in (("small", 1), ("resnet18", 3)):
        module = BACKBONES[net]()
        with FlopCounterMode(display=False) as count, torch.no_grad():
            module.maps(torch.zeros(1, channels, 128, 128))
        found[net] = count.get_total_flops()
    assert found["small"] < 0.1 * found["resnet18"]


def network(names: tuple[str, ...] = ALL, classes: int = 3, net: str = "small") -> Network:
    torch.manual_seed(1)
    k = len(names)
    return Network(net, classes=classes, names=names, offset=torch.zeros(k), scale=torch.linspace(0.5, 1.5, k)).eval()


@pytest.mark.parametrize("net", ["small", "resnet18", "vgg16"])
def test_heads_say_classes_depths_poses_and_covariances(net: str) -> None:
    with torch.no_grad():
        said = network(net=net)(torch.rand(2, 64, 64))
    assert {name: tuple(v.shape) for name, v in said.items()} == {
        "scores": (2, 3), "depth": (2,), "mean": (2, 5), "factor": (2, 5, 5)
    }  # fmt: skip
    assert torch.all(torch.diagonal(said["factor"], dim1=1, dim2=2) > 0)
    assert torch.equal(said["factor"], torch.tril(said["factor"]))


def test_exported_covariances_are_the_inverse_of_the_factors() -> None:
    module = network()
    assert module.pose is not None
    torch.nn.init.normal_(module.pose.spread.weight, std=0.3)
    images = torch.randint(0, 256, (3, 64, 64), dtype=torch.uint8)
    widen = torch.linspace(0.8, 1.2, 5)
    with torch.no_grad():
        factor = module(images / 255.0)["factor"].double()
        covariance = Exported(module, torch.eye(64), torch.eye(64), widen, resize=False)(images)[3]
    spread = torch.diag(widen * module.pose.scale).double()
    expected = spread @ torch.linalg.inv(factor @ factor.mT) @ spread
    assert torch.allclose(covariance.double(), expected, rtol=1e-4, atol=1e-6)


def test_middles_of_mass_tell_where_something_is() -> None:
    head = PoseHead(4, 1, ("x",), torch.zeros(1), torch.ones(1))
    torch.nn.init.constant_(head.points.weight, 50.0)
    maps = torch.zeros(1, 1, 5, 5)
    maps[0, 0, 1, 4] = 1.0
    found = head._middles(maps)[0]
    assert torch.allclose(found[:16], torch.tensor(1.0), atol=1e-3) and torch.allclose(
        found[16:], torch.tensor(-0.5), atol=1e-3
    )


def test_the_paper_loss_is_right_and_its_ablation_wrong() -> None:
    scores, truth = torch.tensor([[9.0, 0.0], [0.0, 9.0], [5.0, 5.0]]), torch.tensor([0, 1, -1])
    depth = torch.tensor([0.0, 1.0, 0.5])
    right = paper_loss(scores, depth, truth, depth, broadcast=False)
    assert float(right) == pytest.approx(math.log1p(math.exp(-9.0)), rel=1e-3)  # the third image has no class
    wrong = paper_loss(scores, depth, truth, depth, broadcast=True)
    assert float(wrong - right) == pytest.approx(0.8 * (4 * 0.25 + 2 * 1.0) / 9)
    # by the ablation the mean of all labels is better than the truth
    middle = paper_loss(scores, torch.full((3,), 0.5), truth, depth, broadcast=True)
    assert float(middle) < float(wrong)


def test_a_turn_round_costs_nothing_where_the_robot_looks_the_same() -> None:
    names, scale = ("tilt", "yaw"), torch.ones(2)
    truth = torch.tensor([[0.3, 3.0]])
    same = torch.tensor([[-0.3, 3.0 - math.pi]])
    near = residuals(same, truth, scale, names, mirrored=True)
    assert near.shape == (2, 1, 2) and float(near[1].abs().max()) < 1e-6
    assert float(residuals(same, truth, scale, names, mirrored=False).abs().max()) > 0.5
    # yaw has no end
    other = residuals(torch.tensor([[0.3, -3.0]]), truth, scale, names, mirrored=False)
    assert float(other[0, 0, 1]) == pytest.approx(6.0 - 2.0 * math.pi, abs=1e-6)


def test_the_density_is_that_of_a_normal_distribution() -> None:
    factor = torch.tensor([[[2.0, 0.0], [0.5, 3.0]]])
    error = torch.tensor([[[0.3, -0.2]]])
    said = torch.distributions.MultivariateNormal(torch.zeros(2), precision_matrix=factor[0] @ factor[0].T)
    assert float(pose_loss(error, factor, 1.0)) == pytest.approx(-float(said.log_prob(error[0, 0])) / 2, rel=1e-5)
    assert float(pose_loss(error, factor, 0.0)) == pytest.approx(0.5 * (0.09 + 0.04) / 2)


def test_a_calibrated_density_is_that_of_a_network_in_use() -> None:
    """Standard deviations are scaled as `widening` does: how sure a network is costs nothing, its errors do."""
    generator = torch.Generator().manual_seed(2)
    error = torch.randn(2, 50, 3, generator=generator, dtype=torch.float64)
    lower = torch.tril(torch.randn(50, 3, 3, generator=generator, dtype=torch.float64), -1)
    factor = lower + torch.diag_embed(0.5 + torch.rand(50, 3, generator=generator, dtype=torch.float64))
    said = calibrated_loss(error[:1], factor)
    covariance = covariances(factor.numpy(), np.ones(3), np.ones(3))
    widen = np.array(widening(error[0].numpy(), covariance))
    assert float(said) == pytest.approx(
        pose_scores(error[0].numpy(), covariance * np.outer(widen, widen), ALL[:3])["nll"] / 3
    )
    overconfident = factor * torch.tensor([7.0, 1.0, 0.1], dtype=torch.float64)[:, None]
    assert float(calibrated_loss(error[:1], overconfident)) == pytest.approx(float(said))
    assert float(pose_loss(error[:1], 7.0 * factor, 1.0)) > float(said)
    # of two poses that look the same the likelier counts
    assert float(calibrated_loss(error, factor)) < float(said)
    assert float(calibrated_loss(2.0 * error[:1], factor)) == pytest.approx(float(said) + math.log(2.0))


def test_augmentation_repeats_and_says_its_shifts() -> None:
    images = torch.zeros(4, 50, 50)
    images[:, 20, 30] = 1.0
    one, steps = augmented(images, torch.Generator().manual_seed(5))
    again, _ = augmented(images, torch.Generator().manual_seed(5))
    assert torch.equal(one, again) and steps.abs().max() <= 2
    for image, (x, y) in zip(one, steps.int().tolist(), strict=True):
        assert divmod(int(image.argmax()), 50) == (20 + y, 30 + x)
