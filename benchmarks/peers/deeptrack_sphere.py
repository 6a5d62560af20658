"""Images of a sphere by DeepTrack2 (Midtvedt et al. 2021, doi:10.1063/5.0034891): bright field in light along the axis.

Its `Brightfield` leads one plane wave through the volume slice by slice, as a beam of one index. A condenser's opening,
that is an incoherent sum over directions, it does not have.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import warnings
from typing import Any

import numpy as np


def missing() -> str | None:
    """Why it cannot run here."""
    return None if importlib.util.find_spec("deeptrack") else "deeptrack is not installed (`pip install deeptrack`)"


def name() -> str:
    """With its version."""
    return f"DeepTrack2 {importlib.metadata.version('deeptrack')}"


def on(device: str, radius: float, index: float, **of: Any) -> tuple[Peer, str | None]:
    """A peer on a GPU of torch; where it cannot compute there by NumPy on the host, and the reason."""
    peer = Peer(radius, index, device=device, **of)
    try:
        peer.image(0.0)
    except RuntimeError as error:
        return Peer(radius, index, **of), str(error).partition("\n")[0]
    return peer, None


class Peer:
    """A sphere in the middle of a square of pixels, looked at in one plane after another.

    Args:
        radius: [µm].
        index: Of the sphere.
        medium, aperture, wavelength, pixel: Of medium and objective; the last two [µm].
        count: Pixels of a side; as many again are computed around each half.
        device: Of torch, whose arrays it computes with then, such as `cuda:0`; None: NumPy's.
    """

    def __init__(
        self,
        radius: float,
        index: float,
        *,
        medium: float,
        aperture: float,
        wavelength: float,
        pixel: float,
        count: int,
        device: str | None = None,
    ):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of packages that it would use if they were there
            import deeptrack

        deeptrack.config.set_device(device or "cpu")
        deeptrack.config.set_backend("torch" if device else "numpy")
        self.deeptrack: Any = deeptrack
        self.pixel, self.sphere = pixel, {"radius": 1e-6 * radius, "refractive_index": index}
        self.middle = (count // 2, count // 2)
        self.optics = deeptrack.Brightfield(
            NA=aperture, wavelength=1e-6 * wavelength, resolution=1e-6 * pixel, magnification=1,
            refractive_index_medium=medium, output_region=(0, 0, count, count), padding=(count // 2,) * 4,
        )  # fmt: skip

    def image(self, focus: float) -> np.ndarray:
        """(count, count) intensity in a focal plane that is `focus` above the sphere [µm]; all is computed anew."""
        ball = self.deeptrack.Sphere(**self.sphere, position=self.middle, z=-focus / self.pixel)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = self.optics(ball).update()()[..., 0]
        return np.asarray(found.cpu() if hasattr(found, "cpu") else found)
