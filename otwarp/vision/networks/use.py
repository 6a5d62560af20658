"""`load`: a trained network from whatever it was kept in."""

from __future__ import annotations

from pathlib import Path

from otwarp.errors import InputError
from otwarp.vision.networks.onnx_file import OnnxEstimator
from otwarp.vision.networks.run import Estimator, TorchEstimator, network_file

MOST_THREADS = 1024
"""Of a network on a CPU."""


def load(path: str | Path, *, device: str | None = None, threads: int = 0) -> Estimator:
    """A trained network, ready to estimate.

    Args:
        path: Folder of a training, its `network.pt`, or an `.onnx` file made from it, which needs no torch.
        device: cpu, cuda:0, …; None: the best there is. Exported files run on the CPU.
        threads: On a CPU, up to 1024; 0 for as many as torch has, or of an exported file all cores. What a network
            says depends on their number in its last bits.

    Raises:
        InputError: There is no network, it is damaged, no such number of threads, or a package is missing.
    """
    if isinstance(threads, bool) or not isinstance(threads, int) or not 0 <= threads <= MOST_THREADS:
        raise InputError(
            f"threads is {threads!r}; allowed: a whole number, 0 to {MOST_THREADS}, 0 for as many as usual"
        )
    found = Path(path)
    if found.suffix == ".onnx" and not found.is_dir():
        return OnnxEstimator(found, threads)
    return TorchEstimator(network_file(found), device, threads)
