"""`load`: a trained network from whatever it was kept in."""

from __future__ import annotations

from pathlib import Path

from otwarp.vision.networks.onnx_file import OnnxEstimator
from otwarp.vision.networks.run import Estimator, TorchEstimator, network_file


def load(path: str | Path, *, device: str | None = None, threads: int = 0) -> Estimator:
    """A trained network, ready to estimate.

    Args:
        path: Folder of a training, its `network.pt`, or an `.onnx` file made from it, which needs no torch.
        device: cpu, cuda:0, …; None: the best there is. Exported files run on the CPU.
        threads: On a CPU; 0 for as many as torch has, or of an exported file all cores. What a network says depends on
            their number in its last bits.

    Raises:
        InputError: There is no network, it is damaged, or a package is missing.
    """
    found = Path(path)
    if found.suffix == ".onnx":
        return OnnxEstimator(found, threads)
    return TorchEstimator(network_file(found), device, threads)
