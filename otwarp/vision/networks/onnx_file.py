"""A network as a file that other programs run: written from a training, and run again by onnxruntime."""

from __future__ import annotations

import hashlib
import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.files import check_place, written
from otwarp.vision.networks.data import area_weights
from otwarp.vision.networks.library import torch_library
from otwarp.vision.networks.predict import Predictions
from otwarp.vision.networks.run import Estimator, TorchEstimator, described_in, network_file
from otwarp.vision.networks.targets import Targets

OPSET = 18
"""Of ONNX."""

KEY = "otwarp"
"""Of the metadata that say what the numbers mean."""

SEAL = b"\x72\x51\x0a\x0dotwarp_sha256\x12\x40"
"""Begins the last entry of the metadata in a file, as protobuf has it (field 14 of a model, 81 bytes: key, value); 64
hexadecimal digits follow, the SHA-256 of all bytes before."""


def export(run: str | Path, file: str | Path) -> tuple[str, ...]:
    """Write a network as ONNX: uint8 images of its data set in, what its heads say out.

    Input `images` (n, height, width) uint8. Outputs, as the heads are: `scores` (n, classes), `depth` (n) normalised,
    `mean` (n, k) and `covariance` (n, k, k) [µm, rad]; names and order of the k quantities stand in the metadata, as
    JSON under the key `otwarp`, and after it a checksum, see `SEAL`.

    Args:
        run: Folder of a training.
        file: Gets the network; must end with .onnx.

    Returns:
        The outputs' names.

    Raises:
        InputError: No such training, another ending, a file that cannot be written, or a package is missing.
    """
    file = Path(file)
    if file.suffix != ".onnx":
        raise InputError(f"--onnx is {file}; allowed: a file that ends with .onnx")
    estimator = TorchEstimator(network_file(run), "cpu")
    check_place(file, "--onnx")
    torch, onnx = torch_library(), _onnx()
    from otwarp.vision.networks.modules.network import Exported

    about, shape = estimator.about, estimator.shape
    rows, columns = (torch.from_numpy(area_weights(n, about["size"])).float() for n in shape)
    widen = torch.tensor(about["widen"] or [1.0] * len(estimator.targets.names))
    module = Exported(estimator.network, rows, columns, widen, resize=shape != (about["size"],) * 2).eval()
    example = torch.zeros(2, *shape, dtype=torch.uint8)
    with written(file, f"--onnx {file}") as part, warnings.catch_warnings(), torch.no_grad():
        warnings.simplefilter("ignore")  # of the exporter, about itself
        torch.onnx.export(
            module, (example,), part, dynamo=False, opset_version=OPSET, input_names=["images"],
            output_names=list(module.names), dynamic_axes={name: {0: "n"} for name in ("images", *module.names)},
        )  # fmt: skip
        model = onnx.load(part)
        onnx.checker.check_model(model)
        entry = model.metadata_props.add()
        entry.key, entry.value = KEY, json.dumps(about, ensure_ascii=False)
        part.write_bytes(_sealed(model.SerializeToString()))
    return module.names


def _sealed(data: bytes) -> bytes:
    """A model with its checksum: protobuf takes what is appended to a message for a part of it."""
    return data + SEAL + hashlib.sha256(data).hexdigest().encode()


def _check_seal(data: bytes, file: Path) -> None:
    """Compare the checksum at the end of a file, where there is one: files had none at first.

    Raises:
        InputError: It differs.
    """
    rest = len(data) - len(SEAL) - 64
    if rest >= 0 and data[rest : rest + len(SEAL)] == SEAL and data != _sealed(data[:rest]):
        raise InputError(f"{file}: is damaged, or another program has changed it: its SHA-256 is not what its metadata "
                         "say; allowed: a file as otwarp vision export wrote it")  # fmt: skip


def _onnx() -> Any:
    try:
        import onnx
    except ImportError:
        raise InputError("writing ONNX files needs the package onnx; install otwarp[vision]") from None
    return onnx


def _runtime() -> Any:
    try:
        import onnxruntime
    except ImportError:
        raise InputError("ONNX files need the package onnxruntime; install otwarp[vision]") from None
    return onnxruntime


class OnnxEstimator(Estimator):
    """An exported network as onnxruntime runs it, on the CPU and without torch.

    Args:
        file: That `export` wrote.
        threads: Of a run; 0 for all cores.

    Raises:
        InputError: It is none, it is damaged, or onnxruntime is missing.
    """

    def __init__(self, file: Path, threads: int = 0):
        if not file.is_file():
            raise InputError(f"{file}: is not there; allowed: a file that otwarp vision export wrote")
        runtime = _runtime()
        options = runtime.SessionOptions()
        options.intra_op_num_threads = threads
        options.log_severity_level = 3
        try:
            data = file.read_bytes()
            _check_seal(data, file)
            self.session = runtime.InferenceSession(data, options, providers=["CPUExecutionProvider"])
            about = json.loads(self.session.get_modelmeta().custom_metadata_map[KEY])
        except InputError:
            raise
        except Exception as error:  # onnxruntime raises its own kinds, by the hundred
            why = " ".join(str(error).split())[:120]
            raise InputError(
                f"{file}: cannot be read ({why}); allowed: a file that otwarp vision export wrote"
            ) from None
        about = described_in(about, file)
        super().__init__(about, Targets.read(about["targets"]))
        self.names = tuple(output.name for output in self.session.get_outputs())

    def _predict(self, images: np.ndarray) -> Predictions:
        said = self.session.run(None, {"images": np.ascontiguousarray(images)})
        return Predictions(**{name: np.asarray(v, dtype=float) for name, v in zip(self.names, said, strict=True)})
