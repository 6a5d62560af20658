"""Complex arrays that Fourier transforms and Warp's kernels share: torch's, or NumPy's where torch is absent."""

from __future__ import annotations

import functools
import math
import os
from typing import Any

import numpy as np
import warp as wp

from otwarp.device import pick_device
from otwarp.errors import InputError

ROOM = 0.45
"""Share of the memory that one array may take: there are two of the largest at a time."""


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

    def check_room(self, *shape: int) -> None:
        """Refuse complex64 arrays of a shape that do not fit the memory, before anything is computed or swapped.

        Raises:
            InputError: They do not.
        """
        needed, there = 8 * math.prod(shape), self._memory()
        if needed > ROOM * there:
            raise InputError(f"light of {' × '.join(map(str, shape))} numbers takes {needed / 2**30:.3g} GiB; allowed "
                             f"on {self.device}: {ROOM * there / 2**30:.3g} GiB, as for focal planes nearer to the "
                             "bodies, a smaller image or margin, or fewer rings")  # fmt: skip

    def _memory(self) -> float:
        """Of the device, or of the machine [bytes]; infinite where nobody tells."""
        if self.device.is_cuda:
            return float(self.device.total_memory)
        try:
            return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
        except (AttributeError, ValueError, OSError):
            return math.inf

    def zeros(self, *shape: int) -> Any:
        """Array of zeros of a shape on the device, complex64.

        Raises:
            InputError: It does not fit the memory.
        """
        self.check_room(*shape)
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

    def corner(self, n: int, b: int, width: int, height: int) -> Corner:
        """Transforms between b × b neighbouring components of n × n and the corner at the origin of their fields."""
        return Corner(self, n, b, width, height)

    def embedded(self, block: Any, n: int) -> Any:
        """(…, n, n) spectra of which (…, b, b) are the components from −b//2 to b//2, in the order of transforms."""
        whole, half = self.zeros(*block.shape[:-2], n, n), block.shape[-1] // 2
        here, there = (slice(half, None), slice(0, half)), (slice(0, half + 1), slice(n - half, n))
        for rows, to_rows in zip(here, there, strict=True):
            for columns, to_columns in zip(here, there, strict=True):
                whole[..., to_rows, to_columns] = block[..., rows, columns]
        return whole

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

    def fields(self, spectra: Any) -> Any:
        """(…, m, m) fields, but for a phase, of spectra (…, m, m); with torch."""
        return _torch().fft.ifft2(spectra, norm="forward").contiguous()

    def landing(self, *shape: int) -> Any:
        """Memory of the host for float32 numbers of the device, which a GPU writes at full speed; with torch."""
        return _torch().empty(shape, dtype=_torch().float32, pin_memory=self.device.is_cuda)

    def land(self, array: Any, landing: Any) -> None:
        """Begin to copy numbers to such memory; they are there when `landed` returns."""
        landing.copy_(array, non_blocking=True)

    def landed(self, landing: Any) -> np.ndarray:
        """Such memory, all of it written."""
        if self.device.is_cuda:
            _torch().cuda.synchronize(self._torch_device)
        return landing.numpy()

    def resampled(self, images: Any, pixels: int, blur: Any) -> Any:
        """(…, pixels, pixels) of real images (…, m, m) of the same square, each frequency times `blur`; with torch."""
        fft = _torch().fft
        spectrum = padded(fft.rfft2(images), images.shape[-1], pixels)
        return fft.irfft2(spectrum * blur, s=(pixels, pixels))

    def waves(self, at: np.ndarray, vectors: np.ndarray) -> Any:
        """(f, …) plane waves of vectors (3, …) [1/µm] in points (f, 3) [µm], phases in float64; with torch."""
        torch = _torch()
        here, k = (torch.from_numpy(np.asarray(a, dtype=float)).to(self._torch_device) for a in (at, vectors))
        phase = torch.tensordot(here, k, dims=1)
        return torch.complex(torch.cos(phase).float(), torch.sin(phase).float())

    def complex(self, real: Any, imaginary: Any) -> Any:
        """Complex numbers of two arrays of float32; with torch."""
        return _torch().complex(real, imaginary)

    def turned(self, phase: Any) -> Any:
        """e^{i phase} − 1, as exact for small phases; with torch."""
        return self.complex(-2.0 * (0.5 * phase).sin() ** 2, phase.sin())

    def inverse(self, values: Any, n: int, axis: int) -> Any:
        """Fields along an axis, of the first components of n."""
        if self.library == "scipy":
            from scipy import fft

            return fft.ifft(values, n=n, axis=axis, norm="forward")
        return _torch().fft.ifft(values, n=n, dim=axis, norm="forward")

    def forward(self, values: Any, n: int, axis: int) -> Any:
        """All n components along an axis, of fields that are 0 beyond their first points."""
        if self.library == "scipy":
            from scipy import fft

            return fft.fft(values, n=n, axis=axis, norm="forward")
        return _torch().fft.fft(values, n=n, dim=axis, norm="forward")

    @property
    def _torch_device(self) -> Any:
        return wp.device_to_torch(self.device)


class Corner:
    """Fields in a small box, of a band of frequencies, and back.

    Fields are those of the components 0 to b − 1: but for a phase that depends on place alone, and goes with the way
    back, those of any b neighbours. Small boxes are products with matrices, which do more arithmetic than fast
    transforms, in a fraction of the time.

    Args:
        fourier: Where.
        n: Points along each side of the square that repeats.
        b: Components along each side.
        width, height: Of the box [points].
    """

    def __init__(self, fourier: Fourier, n: int, b: int, width: int, height: int):
        self._fourier, self._n, self._b, self._size = fourier, n, b, (height, width)
        small = min(width, height)
        arithmetic = 8 * b * small * (b + max(width, height))
        self._dense = arithmetic < DENSE * 5 * n * math.log2(n) * (b + small)
        if self._dense:
            phase = 2.0 * math.pi / n * np.outer(np.arange(b), np.arange(max(width, height)))
            waves = np.exp(1j * phase)
            self._out = [fourier.array(w) for w in (waves[:, :height].T, waves[:, :width])]
            self._back = [fourier.array(w.conj() / n) for w in (waves[:, :height], waves[:, :width].T)]

    def field(self, spectrum: Any) -> Any:
        """(…, height, width) fields of (…, b, b)."""
        height, width = self._size
        if self._dense:
            return self._product(self._out, spectrum, rows_first=height <= width)
        along = self._fourier.inverse(spectrum, self._n, -1)[..., :width]
        return self._fourier.inverse(along, self._n, -2)[..., :height, :]

    def spectrum(self, field: Any) -> Any:
        """(…, b, b) components of fields (…, height, width) that are 0 beyond the box."""
        height, width = self._size
        if self._dense:
            found = self._product(self._back, field, rows_first=height > width)
        else:
            along = self._fourier.forward(field, self._n, -2)[..., : self._b, :]
            found = self._fourier.forward(along, self._n, -1)[..., : self._b]
        return np.ascontiguousarray(found) if isinstance(found, np.ndarray) else found.contiguous()

    @staticmethod
    def _product(sides: list[Any], middle: Any, *, rows_first: bool) -> Any:
        left, right = sides
        return (left @ middle) @ right if rows_first else left @ (middle @ right)


def padded(spectrum: Any, m: int, pixels: int) -> Any:
    """(…, pixels, pixels // 2 + 1) components of real images with `pixels` points a side, of those with m, no more."""
    if m == pixels:
        return spectrum
    new = np.zeros if isinstance(spectrum, np.ndarray) else spectrum.new_zeros
    whole = new((*spectrum.shape[:-2], pixels, pixels // 2 + 1), dtype=spectrum.dtype)
    half = (m + 1) // 2  # the highest frequency of an even number of points is empty
    whole[..., :half, :half] = spectrum[..., :half, :half]
    whole[..., pixels - half + 1 :, :half] = spectrum[..., m - half + 1 :, :half]
    return whole * (pixels / m) ** 2


DENSE = 12
"""How many times as fast matrices are multiplied as transformed, for the same arithmetic; no more than a choice. On an
H100 32 × 61 fields of 26 × 11 points and back are 0.40 ms by matrices and 1.1 ms one way by transforms."""


@functools.cache
def _torch() -> Any:
    """The package torch, imported once, or None where it cannot be: its absence is no error, SciPy stands in."""
    try:
        import torch
    except ImportError:
        return None
    return torch
