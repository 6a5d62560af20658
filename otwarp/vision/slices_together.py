"""Many specimens cut into slices, and light led through all of them side by side: they fill a GPU, which one does not.

The first slice of every specimen is passed at once, then the second, and so on; their boxes are as wide as that of the
widest, and specimens with fewer slices than others end with empty ones.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from otwarp.vision.fourier import Fourier
from otwarp.vision.grid import Grid, axial_wavenumbers
from otwarp.vision.kernels.advance import add_and_carry, add_scattered, carry
from otwarp.vision.kernels.voxels import fill_slices
from otwarp.vision.microscope import Microscope
from otwarp.vision.slices import Method, box_of, layers_of
from otwarp.vision.specimen import Specimen

GROUP_BYTES = 2**28
"""Of the amplitudes that go through specimens together."""


@dataclass(frozen=True, eq=False)
class Stacks:
    """Specimens as stacks of slices.

    Attributes:
        corner: Cell of the grid where the box around all of them begins (x, y).
        size: Cells along each side of that box (x, y).
        low: (p) height where each begins [µm].
        thickness: (p) of its slices [µm].
        layers: (p) of its slices.
    """

    corner: tuple[int, int]
    size: tuple[int, int]
    low: np.ndarray
    thickness: np.ndarray
    layers: np.ndarray

    @classmethod
    def of(cls, specimens: Sequence[Specimen], grid: Grid, thickness: float) -> Stacks:
        """Cut specimens, none of which is empty, into slices of at most a thickness [µm].

        Raises:
            InputError: One reaches beyond the grid's square.
        """
        boxes = [box_of(specimen, grid) for specimen in specimens]
        first = np.min([corner for corner, _ in boxes], axis=0)
        beyond = np.max([np.add(corner, size) for corner, size in boxes], axis=0)
        low, high = (np.array([getattr(s, side)[2] for s in specimens]) for side in ("low", "high"))
        layers = np.array([layers_of(*ends, thickness) for ends in zip(low, high, strict=True)])
        corner, size = (tuple(int(v) for v in pair) for pair in (first, beyond - first))
        return cls(corner, size, low, (high - low) / layers, layers)  # type: ignore[arg-type]

    @property
    def most(self) -> int:
        """Slices of the highest."""
        return int(self.layers.max())

    def middles(self) -> np.ndarray:
        """(slices, p) height of the middle of each slice [µm]."""
        return self.low + (np.arange(self.most)[:, None] + 0.5) * self.thickness


@dataclass(frozen=True, eq=False)
class Waves:
    """The plane waves of a spectrum that travel in the medium; arrays of the device.

    Attributes:
        vacuum, medium: Their wavenumbers there [1/µm].
        axial: (b²) axial wavenumbers in the medium [1/µm].
        inside: By refractive index: (b²) axial wavenumbers in solids [1/µm].
        travels: (b²) 1 where a wave travels in the medium, else 0.
    """

    vacuum: float
    medium: float
    axial: Any
    inside: dict[float, Any]
    travels: Any

    @classmethod
    def of(
        cls, microscope: Microscope, indices: np.ndarray, grid: Grid, here: tuple[np.ndarray, ...], fourier: Fourier
    ) -> Waves:
        """Of one wavelength, in the medium and in solids of some indices; of the components `here` of the spectrum."""
        vacuum, medium = 2.0 * math.pi / microscope.wavelength, microscope.wavenumber
        axial, travels = (a[here].ravel() for a in axial_wavenumbers(medium, grid))
        inside = {float(i): fourier.array(axial_wavenumbers(vacuum * i, grid)[0][here].ravel()) for i in indices}
        return cls(vacuum, medium, fourier.array(axial), inside, fourier.array(travels.astype(np.float32)))


def pass_together(
    specimens: Sequence[Specimen],
    stacks: Stacks,
    amplitude: Any,
    waves: Waves,
    grid: Grid,
    fourier: Fourier,
    method: Method,
) -> None:
    """Lead light through specimens, in place.

    Args:
        specimens: (p) relative to the optical axis.
        stacks: The same as slices.
        amplitude: (p, s, b, b) of plane waves at height 0, of every specimen its own.
        waves: What they are.
        grid: Where.
        fourier: On what, with torch.
        method: Rung of the ladder.
    """
    poses, sources, b, _ = amplitude.shape
    rows = poses * sources
    media = [_medium(specimens, index, stacks, waves, grid, fourier, method) for index in waves.inside]
    middles = stacks.middles()
    if method == "projection":
        phase = sum(share.sum(1, keepdim=True) for share, _ in media)
        media, middles = (
            [(fourier.turned(phase), media[0][1])],
            (stacks.low + 0.5 * stacks.layers * stacks.thickness)[None],
        )
    carriers = (fourier.turned(fourier.array(middles[..., None]) * waves.axial) + 1.0) * waves.travels
    corner = fourier.corner(grid.cells, b, *stacks.size)
    spectrum = fourier.zeros(poses, sources, b, b)
    flat = [fourier.warp(a.reshape(rows, b * b)) for a in (amplitude, spectrum)]
    each, device = (rows, b * b), fourier.device
    views = [fourier.warp(one) for one in carriers]
    wp.launch(carry, dim=each, inputs=[views[0], sources, *flat], device=device)
    for m, here in enumerate(views):
        field = corner.field(spectrum)
        for n, (share, gain) in enumerate(media):
            scattered = fourier.warp(corner.spectrum(field * share[:, m, None]).reshape(rows, b * b))
            known = [scattered, fourier.warp(gain), here]
            if n + 1 < len(media) or m + 1 == len(views):
                wp.launch(add_scattered, dim=each, inputs=[*known, sources, flat[0]], device=device)
            else:
                wp.launch(add_and_carry, dim=each, inputs=[*known, views[m + 1], sources, *flat], device=device)


def _medium(
    specimens: Sequence[Specimen],
    index: float,
    stacks: Stacks,
    waves: Waves,
    grid: Grid,
    fourier: Fourier,
    method: Method,
) -> tuple[Any, Any]:
    """What solids of an index multiply the field with (p, slices, height, width), and its spectrum (p, b²)."""
    share = _shares(specimens, index, stacks, grid, fourier)
    delay = fourier.array(((waves.vacuum * index - waves.medium) * stacks.thickness)[:, None, None, None])
    thickness = fourier.array(stacks.thickness[:, None])
    if method == "two_index":
        bend = waves.inside[index] - waves.axial
        return _mixed(share, delay, fourier), fourier.turned(thickness * bend) * waves.travels
    whole = (waves.travels + 0.0 * thickness).to(fourier.zeros(1).dtype)
    return (share * delay if method == "projection" else fourier.turned(share * delay)), whole


def _shares(specimens: Sequence[Specimen], index: float, stacks: Stacks, grid: Grid, fourier: Fourier) -> Any:
    """(p, slices, height, width) share of each cell that solids of an index fill."""
    mine = [specimen.index == index for specimen in specimens]
    start, end, radius = (np.concatenate([getattr(s, name)[m] for s, m in zip(specimens, mine, strict=True)])
                          for name in ("start", "end", "radius"))  # fmt: skip
    first = np.concatenate([[0], np.cumsum([int(m.sum()) for m in mine])])
    width, height = stacks.size
    share, device = fourier.array(np.zeros((len(mine), stacks.most, height, width), np.float32)), fourier.device
    solids = [wp.array(a, dtype=wp.vec3, device=device) for a in (start, end)]
    numbers = [wp.array(a, dtype=float, device=device) for a in (radius, stacks.low, stacks.thickness)]
    whole = [wp.array(a, dtype=int, device=device) for a in (first, stacks.layers)]
    corner = wp.vec2(*(np.array(stacks.corner) * grid.spacing - 0.5 * grid.length))
    inputs = [*solids, numbers[0], whole[0], corner, grid.spacing, *numbers[1:], whole[1], fourier.warp(share)]
    wp.launch(fill_slices, dim=tuple(share.shape), inputs=inputs, device=device)
    return share


def _mixed(share: Any, delay: Any, fourier: Fourier) -> Any:
    """`otwarp.vision.slices.mixed`, (e^{i share·delay} − 1) / (e^{i delay} − 1), of a delay for each specimen."""
    half = 0.5 * delay
    seen = half.abs() > 5e-7  # else no solid to be seen
    size = (half * share).sin() / half.sin().where(seen, 1.0 + 0.0 * half)
    bend = half * (share - 1.0)
    return fourier.complex((size * bend.cos()).where(seen, share), (size * bend.sin()).where(seen, 0.0 * share))
