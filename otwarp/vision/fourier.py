"""Complex arrays that Fourier transforms and Warp's kernels share: torch's, or NumPy's where torch is absent."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import warp as wp

from otwarp.device import pick_device
from otwarp.errors import InputError


class Fourier:
    """Transforms on a device.

    Args:
        device: Warp's name of it; None for a GPU if there is one.
        library: `torch` or `scipy`; None for torch where it can be imported.

    Raises:
        InputError: No such device or library, or a GPU without torch.
    """

    def __init__(self, device: str | None = None, library: str | None = None):
        self.device = pick_device(device)
        self.library = library or ("torch" if _torch() is not None else "scipy")
        if self.library not in ("torch", "scipy"):
            raise InputError(f"library is {library!r}; allowed: torch, scipy")
        if self.library == "torch" and _torch() is None:
            raise InputError("library is torch, which cannot be imported; install otwarp[vision]")
        if self.library == "scipy" and self.device.is_cuda:
            raise InputError(f"images on {self.device} need torch; install otwarp[vision], or use device cpu")

    def array(self, values: np.ndarray) -> Any:
        """The same numbers on the device, complex64 or float32."""
        kept = np.ascontiguousarray(values, dtype=np.complex64 if np.iscomplexobj(values) else np.float32)
        if self.library == "scipy":
            return kept
        return _torch().from_numpy(kept.copy()).to(self._torch_device)

    def zeros(self, *shape: int) -> Any:
        """Zeros, complex64."""
        if self.library == "scipy":
            return np.zeros(shape, dtype=np.complex64)
        return _torch().zeros(shape, dtype=_torch().complex64, device=self._torch_device)

    def numpy(self, array: Any) -> np.ndarray:
        """An array of the device on the host."""
        return array if isinstance(array, np.ndarray) else array.cpu().numpy()

    def warp(self, array: Any) -> wp.array:
        """A view of an array for kernels: complex numbers as `wp.vec2f`."""
        if isinstance(array, np.ndarray):
            if array.dtype == np.complex64:
                return wp.array(
                    array.view(np.float32).reshape(*array.shape, 2), dtype=wp.vec2f, device="cpu", copy=False
                )
            return wp.array(array, dtype=wp.float32, device="cpu", copy=False)
        torch = _torch()
        if array.dtype == torch.complex64:
            return wp.from_torch(torch.view_as_real(array), dtype=wp.vec2f)
        return wp.from_torch(array, dtype=wp.float32)

    def field(self, spectrum: Any, width: int, height: int) -> Any:
        """(…, height, width) the corner at the origin of fields, from spectra (…, n, n); the rest is not computed."""
        along = self._inverse(spectrum, -1)[..., :width]
        return self._inverse(along, -2)[..., :height, :]

    def spectrum(self, field: Any, n: int) -> Any:
        """(…, n, n) spectra of fields that are (…, height, width) at the origin and 0 elsewhere."""
        return self._forward(self._forward(field, n, -2), n, -1)

    def block(self, spectra: Any, index: np.ndarray) -> Any:
        """(…, b, b) components of spectra (…, n, n) whose rows and columns have these numbers, side by side."""
        if self.library == "scipy":
            return np.ascontiguousarray(spectra[..., index, :][..., index])
        which = _torch().from_numpy(index).to(spectra.device)
        return spectra.index_select(-2, which).index_select(-1, which)

    def image(self, spectrum: Any, m: int) -> Any:
        """(…, m, m) fields, but for a phase, of b × b neighbouring components of their spectra; m is b or more."""
        if self.library == "scipy":
            from scipy import fft

            return fft.ifft(fft.ifft(spectrum, n=m, axis=-2, norm="forward"), n=m, axis=-1, norm="forward")
        fft = _torch().fft
        return fft.ifft(fft.ifft(spectrum, n=m, dim=-2, norm="forward"), n=m, dim=-1, norm="forward").contiguous()

    def _inverse(self, values: Any, axis: int) -> Any:
        if self.library == "scipy":
            from scipy import fft

            return fft.ifft(values, axis=axis, norm="forward")
        return _torch().fft.ifft(values, dim=axis, norm="forward")

    def _forward(self, values: Any, n: int, axis: int) -> Any:
        if self.library == "scipy":
            from scipy import fft

            return fft.fft(values, n=n, axis=axis, norm="forward")
        return _torch().fft.fft(values, n=n, dim=axis, norm="forward")

    @property
    def _torch_device(self) -> Any:
        return wp.device_to_torch(self.device)


@functools.cache
def _torch() -> Any:
    """The package torch, or None."""
    try:
        import torch
    except ImportError:
        return None
    return torch
