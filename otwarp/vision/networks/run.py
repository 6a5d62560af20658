"""A trained network in use: images in, estimates out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.vision.networks import checkpoint
from otwarp.vision.networks.build import rebuilt
from otwarp.vision.networks.captured import CapturedNetwork
from otwarp.vision.networks.data import Resizing
from otwarp.vision.networks.estimate import Estimate
from otwarp.vision.networks.library import check_device_name, memory_named, threads_of, torch_device, torch_library
from otwarp.vision.networks.predict import BATCH, Predictions, gathered
from otwarp.vision.networks.targets import Targets
from otwarp.vision.networks.weights import put

FEW = 16
"""Images up to which a GPU waits for launches."""


class Estimator(ABC):
    """A network with what it takes to use it; made by `use.load`.

    Attributes:
        about: What its file says: `net`, `shape`, `pixel` [µm], `size`, `epoch`, `weights`, …
        targets: What it says of an image.
    """

    def __init__(self, about: dict[str, Any], targets: Targets):
        self.about, self.targets = about, targets

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the images that it takes [pixels]."""
        return self.about["shape"][0], self.about["shape"][1]

    @property
    def pixel(self) -> float:
        """Of these images [µm]."""
        return float(self.about["pixel"])

    @property
    def quantities(self) -> tuple[str, ...]:
        """Quantities of the pose that it says; none with the paper's heads."""
        return () if self.about["heads"] == "paper" else self.targets.names

    def predict(self, images: np.ndarray) -> Predictions:
        """What all heads say of images; `estimate` has the argument and the errors."""
        found = self._checked(images)
        if not len(found):  # of no image the same arrays, empty
            said = vars(self._predict(np.zeros((1, *self.shape), dtype=np.uint8)))
            return Predictions(**{name: value[:0] for name, value in said.items() if value is not None})
        return self._predict(found)

    def estimate(self, images: np.ndarray) -> list[Estimate]:
        """Poses with their covariances.

        Args:
            images: uint8 (n, height, width), or one image; row 0 the lowest, of `shape` and `pixel`.

        Raises:
            InputError: Images of another shape or type, or a network without a pose's head.
        """
        names = self.quantities
        if not names:
            raise InputError(f"heads of the network is {self.about['heads']}, which say classes and normalised depth "
                             "alone; allowed: both or pose")  # fmt: skip
        said = self.predict(images)
        assert said.mean is not None and said.covariance is not None
        others = dict(self.targets.others)
        return [Estimate.of(names, m, c, others) for m, c in zip(said.mean, said.covariance, strict=True)]

    def _checked(self, images: np.ndarray) -> np.ndarray:
        found = np.asarray(images)
        if found.ndim == 2:
            found = found[None]
        if found.dtype != np.uint8 or found.shape[1:] != self.shape:
            height, width = self.shape
            raise InputError(f"images is {found.dtype} {found.shape}; allowed: uint8 (n, {height}, {width}), as the "
                             "network was trained on")  # fmt: skip
        return found

    @abstractmethod
    def _predict(self, images: np.ndarray) -> Predictions:
        """As `predict`, of images (n, height, width) uint8 of the right shape."""


class TorchEstimator(Estimator):
    """The network as torch runs it.

    Args:
        file: That a training wrote.
        device: torch's name; None for a GPU if there is one.
        threads: On a CPU; 0 for as many as torch has.

    Attributes:
        network: Module of torch.
        device: torch's.
    """

    def __init__(self, file: Path, device: str | None = None, threads: int = 0):
        check_device_name(device)
        found = checkpoint.load(file, "a folder that otwarp vision train wrote, after its first epoch")
        where = torch_device(device)
        about = described_in(found.get("about"), file)
        module, targets = rebuilt(about)
        put(module, found.get("state", {}), f"{file}: weights of another network than {about['net']}")
        super().__init__(about, targets)
        self.device, self._threads = where, threads
        with memory_named(f"{file}: the network", where):
            self.network = module.to(where).to(memory_format=torch_library().channels_last).eval()
        for parameter in self.network.parameters():
            parameter.requires_grad_(False)
        self._resizing = Resizing(self.shape, about["size"], where)
        self._captured = CapturedNetwork(self._seen) if where.type == "cuda" else None

    def _predict(self, images: np.ndarray) -> Predictions:
        batch = f"batch is {min(len(images), BATCH)}, which"
        with threads_of(self._threads), torch_library().inference_mode(), memory_named(batch, self.device):
            return gathered(self._look, images, self.targets, tuple(self.about["widen"]))

    def _look(self, images: np.ndarray) -> dict[str, Any]:
        """What the network says of images of the host."""
        there = torch_library().from_numpy(np.ascontiguousarray(images)).to(self.device)
        return self._captured(there) if self._captured is not None and len(images) <= FEW else self._seen(there)

    def _seen(self, images: Any) -> dict[str, Any]:
        """What it says of images of the device, made as large as it takes them."""
        return self.network(self._resizing(images).float() / 255.0)


NEEDED = ("net", "heads", "targets", "size", "shape", "pixel", "grey", "widen")
"""What a file must say of its network."""


def described_in(about: Any, file: Path) -> dict[str, Any]:
    """What a file says of its network.

    Args:
        about: As it was found in the file.
        file: For the message.

    Raises:
        InputError: It says too little to use the network, as the checkpoint of a training does.
    """
    missing = [name for name in NEEDED if not isinstance(about, dict) or name not in about]
    if missing:
        raise InputError(f"{file}: does not say {missing[0]} of its network; allowed: network.pt of a training, or "
                         "what otwarp vision export wrote")  # fmt: skip
    return about


def network_file(path: str | Path) -> Path:
    """`network.pt` of a training, whatever its folder is called, or the file itself."""
    found = Path(path)
    return found if found.suffix == ".pt" and not found.is_dir() else found / checkpoint.NETWORK
