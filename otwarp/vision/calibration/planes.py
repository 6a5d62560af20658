"""Heights from sweeps of the focus over a bead: where the trap holds it, and how far refocusing really goes.

A sweep is compared with what the microscope renders of the bead, which knows that a bead is a lens: nothing in its
image is sharpest when its centre is in focus.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import optimize

from otwarp.errors import InputError
from otwarp.vision.calibration.measured import Measured
from otwarp.vision.microscope import Microscope
from otwarp.vision.rendering import Exposed


@dataclass(frozen=True)
class Sweep:
    """Where a bead is by a sweep.

    Attributes:
        focus: Nominal position of the focus at which its centre is in the focal plane [µm].
        scale: How far the focal plane moves through the liquid for a nominal µm.
        error: Standard errors of these two.
        rest: Root mean square of what the model leaves, over the contrast of the images.
    """

    focus: float
    scale: float
    error: tuple[float, float]
    rest: float


def fit_sweep(images: np.ndarray, focus: np.ndarray, bead: Exposed, *, scaled: bool = False) -> Sweep:
    """Find the focus of a bead by least squares over all images; its place and the light's brightness are fitted, too.

    Args:
        images: (f, height, width) of the bead near the middle, any brightness.
        focus: (f) nominal positions of the focus, upwards [µm].
        bead: Light that has passed such a bead at the origin, for images of that size.
        scaled: Whether the focal plane may move less, or more, than nominally.

    Raises:
        InputError: Too few images, or another size.
    """
    light, nominal = np.asarray(images, dtype=float), np.asarray(focus, dtype=float)
    size = (bead.grid.height, bead.grid.width)
    if len(nominal) < 3 or light.shape != (len(nominal), *size):
        raise InputError(f"images are {light.shape} for {len(nominal)} positions of the focus; allowed: 3 or more, of "
                         f"{size[1]} × {size[0]} pixels")  # fmt: skip
    light = light / np.median(light)

    def seen(one: np.ndarray) -> np.ndarray:
        where = one - 1.0 + base  # steps of differences are relative, and images of single precision
        planes = where[4] * (nominal - where[0]) if scaled else nominal - where[0]
        return where[3] * bead.images(planes, shift=np.tile(where[1:3], (len(nominal), 1)))

    base = np.array([_guess(light, nominal, bead), 0.0, 0.0, 1.0, 1.0])[: 5 if scaled else 4]
    found = optimize.least_squares(lambda one: (seen(one) - light).ravel(), np.ones(len(base)), diff_step=3e-3,
                                   method="lm", xtol=1e-5, ftol=1e-6)  # fmt: skip
    freedom, place = light.size - len(base), found.x - 1.0 + base
    spread = np.linalg.inv(found.jac.T @ found.jac) * 2.0 * found.cost / freedom
    error = np.sqrt(np.diag(spread))
    rest = np.sqrt(np.mean(found.fun**2) / np.mean((light - 1.0) ** 2))
    return Sweep(float(place[0]), float(place[4]) if scaled else 1.0,
                 (float(error[0]), float(error[4]) if scaled else 0.0), float(rest))  # fmt: skip


def _guess(light: np.ndarray, nominal: np.ndarray, bead: Exposed) -> float:
    """The shift at which the sweep is most like the bead's."""
    length = float(np.ptp(nominal))
    planes = np.linspace(-1.0, 1.0, 41) * length
    model = bead.images(planes)
    shifts = 0.5 * (nominal.min() + nominal.max()) + np.linspace(-0.4, 0.4, 33) * length
    nearest = [np.abs(planes[None, :] - (nominal - by)[:, None]).argmin(axis=1) for by in shifts]
    return float(shifts[np.argmin([np.sum((model[which] - light) ** 2) for which in nearest])])


def trap_plane(images: np.ndarray, focus: np.ndarray, bead: Exposed, *, authored: float | None = None) -> Measured:
    """Height of a trapped or stuck bead above the camera's own focal plane, from a sweep of the focus.

    Args:
        images, focus, bead: See `fit_sweep`; positions are relative to the camera's own focal plane.
        authored: Where the bead was rendered [µm].
    """
    found = fit_sweep(images, focus, bead)
    freedom = images.size - 4
    return Measured.of(found.focus, found.error[0], freedom, "um", "height of the trap plane above the focal plane",
                       authored)  # fmt: skip


def depth_scale(heights: np.ndarray, focus: np.ndarray, *, authored: float | None = None) -> Measured:
    """How far the focal plane really moves for a nominal µm, from stuck beads at known heights.

    Args:
        heights: (k) distances of the beads from the cover glass [µm].
        focus: (k) nominal refocus distances at which each is in focus [µm].
        authored: What it should be.

    Raises:
        InputError: Fewer than three beads, or all at one height.
    """
    h, n = np.asarray(heights, dtype=float), np.asarray(focus, dtype=float)
    if len(h) < 3 or np.ptp(h) <= 0.0 or n.shape != h.shape:
        raise InputError(f"there are {len(h)} beads; allowed: three or more, at heights that differ")
    away = h - h.mean()
    slope = np.sum(away * n) / np.sum(away**2)
    rest = n - n.mean() - slope * away
    error = np.sqrt(np.sum(rest**2) / (len(h) - 2) / np.sum(away**2))
    return Measured.of(1.0 / slope, error / slope**2, len(h) - 2, "1",
                       "distance in the liquid for a nominal one of refocusing", authored)  # fmt: skip


def expected_depth_scale(microscope: Microscope, points: int = 2001) -> float:
    """The depth scale at which defocus undoes most of an index mismatch, in the mean square over the pupil.

    Light of a point at height h below glass has the phase h k_z − N k_z′ (k_z and k_z′ in liquid and immersion) in an
    objective that is nominally focused at N; of all N the one is sought whose phase is nearest to constant.
    """
    vacuum = 2.0 * np.pi / microscope.wavelength
    q = np.sqrt(np.linspace(0.0, microscope.cutoff**2, points))  # even in the pupil's area
    liquid, glass = (np.sqrt(np.maximum((vacuum * n) ** 2 - q**2, 0.0))
                     for n in (microscope.medium_index, microscope.immersion_index))  # fmt: skip
    liquid, glass = liquid - liquid.mean(), glass - glass.mean()
    return float(np.sum(glass**2) / np.sum(liquid * glass))
