"""Weights to begin with: torchvision's files where the user has them, or another file; never another thing silently."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from otwarp.errors import InputError
from otwarp.vision.networks.library import torch_library

FILES = {"resnet18": "resnet18-f37072fd.pth", "resnet50": "resnet50-0676ba61.pth", "vgg16": "vgg16-397923af.pth"}
"""Published by torchvision (IMAGENET1K_V1); the digits begin the file's SHA-256."""

ADDRESS = "https://download.pytorch.org/models/"


def find_weights(net: str, weights: str) -> Path | None:
    """The file of weights that is meant, None for none.

    Args:
        net: Name of the network.
        weights: `none`, `imagenet`, or a path.

    Raises:
        InputError: It is not there.
    """
    if weights == "none":
        return None
    if weights != "imagenet":
        if not Path(weights).is_file():
            raise InputError(f"--weights is {weights}, which is no file; allowed: none, imagenet, or a file of weights")
        return Path(weights)
    folder = Path(torch_library().hub.get_dir()) / "checkpoints"
    file = folder / FILES[net]
    if not file.is_file():
        raise InputError(f"--weights is imagenet, but {file} is not there; allowed: put {ADDRESS}{FILES[net]} there, "
                         "or name the file, or none")  # fmt: skip
    return file


def load_weights(backbone: Any, net: str, weights: str) -> dict[str, str]:
    """Put weights into a backbone, and say which.

    Args:
        backbone: Module of torch.
        net: Its name.
        weights: `none`, `imagenet`, or a path.

    Returns:
        `source`, and of a file `file` and `sha256`.

    Raises:
        InputError: They are not there, are damaged, or those of another network.
    """
    file = find_weights(net, weights)
    if file is None:
        return {"source": "none"}
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    begin = FILES.get(net, "").rpartition("-")[2].removesuffix(".pth")
    if weights == "imagenet" and not digest.startswith(begin):
        raise InputError(f"{file}: is damaged: its SHA-256 begins with {digest[:8]}; allowed: {begin}")
    put(backbone, read_file(file), f"{file}: weights of another network than {net}")
    return {"source": "imagenet" if weights == "imagenet" else "file", "file": file.name, "sha256": digest}


def read_file(file: Path) -> dict[str, Any]:
    """What a file of torch holds, tensors and plain values alone.

    Raises:
        InputError: It is none.
    """
    torch = torch_library()
    try:
        found = torch.load(file, map_location="cpu", weights_only=True)
    except FileNotFoundError:
        raise InputError(f"{file}: is not there; allowed: a file that otwarp vision train wrote") from None
    except Exception as error:  # torch raises whatever its readers of archives and pickles raise
        kind = type(error).__name__
        raise InputError(f"{file}: cannot be read, it is cut short, damaged or of another kind ({kind}); allowed: a "
                         "file of torch with weights, whole") from None  # fmt: skip
    if not isinstance(found, dict):
        raise InputError(f"{file}: holds no dictionary of weights; allowed: a file of torch with weights")
    return found


def put(module: Any, state: dict[str, Any], what: str) -> None:
    """Load a state into a module, all of it or nothing.

    Args:
        module: Of torch.
        state: Its tensors by name.
        what: How an error begins.

    Raises:
        InputError: Names or shapes differ.
    """
    own = module.state_dict()
    for name in (*own, *state):
        there, here = (tuple(s[name].shape) if hasattr(s.get(name), "shape") else None for s in (state, own))
        if there != here:
            words = "nothing" if there is None else f"shape {there}"
            raise InputError(f"{what}: {name} is {words}; allowed: {'nothing' if here is None else f'shape {here}'}")
    module.load_state_dict(state)
