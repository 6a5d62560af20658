"""Mobility of spheres and rods stuck together, refined by surface blobs until a wanted accuracy is reached.

Coverings with N, 2N, 4N … blobs for each sphere are solved in turn. The self terms of `surface` take the error to order
h³ in the spacing, so that with the change Δ of the last doubling Richardson's extrapolation adds Δ/(2^{3/2} − 1). Δ
bounds what is left, with room to spare, and is reported as the error; refinement ends when Δ, relative to the diagonal,
is within the wanted accuracy.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.hydrodynamics.covering import (
    COINCIDENT,
    Covering,
    Elements,
    cover,
    node_counts,
    outermost_spheres,
    swallowed,
)
from otwarp.hydrodynamics.rigid import (
    BodyMobility,
    about_centre_of_diffusion,
    assemble,
    inverse,
    relative_change,
    shift,
    symmetric,
)
from otwarp.hydrodynamics.sphere_coupling import sphere_coupling
from otwarp.hydrodynamics.surface import surface_friction
from otwarp.hydrodynamics.symmetry import Symmetry, body_frame, symmetries

COARSEST = 12
"""Blobs on a whole sphere at the first level; a touching dimer is within 0.6 % even there."""

MOST_BLOBS = 3000
"""Blobs of the largest system: 1.2 GB and some 8 s on one core."""

MOST_HIDDEN = 4 * MOST_BLOBS
"""Nodes beyond which a covering is not tried, most of which may be inside other elements."""

ORDER = 3.0
"""Order of the error in the spacing: measured 2.4 to 3 for touching, overlapping and connected bodies."""

EXTRAPOLATION = 1.0 / (2.0 ** (0.5 * ORDER) - 1.0)
"""What the change of one doubling of the blobs (spacing divided by √2) still leaves out."""


def assembly_mobility(
    centres: np.ndarray,
    radii: np.ndarray,
    rods: tuple[np.ndarray, np.ndarray, np.ndarray],
    accuracy: float,
) -> BodyMobility:
    """Mobility of spheres and rods held rigidly together.

    Args:
        centres: (n, 3) sphere centres [µm].
        radii: (n,) µm.
        rods: Ends (m, 3), (m, 3) and radii (m,) of the rods, which are rounded [µm].
        accuracy: Wanted relative error, in (0, 0.5].

    Returns:
        The mobility, with one flow coupling for each sphere; rods follow the flow through the spheres nearest to them.

    Raises:
        InputError: More than `MOST_BLOBS` blobs would be needed.
    """
    spheres = outermost_spheres(centres, radii)
    everything = Elements(
        np.concatenate([centres[spheres], rods[0]]),
        np.concatenate([centres[spheres], rods[1]]),
        np.concatenate([radii[spheres], rods[2]]),
    )
    elements, middle = _centred(_without_buried_rods(everything, len(spheres)))
    frame, group = body_frame(elements), symmetries(elements)

    def covering(fineness: int) -> Covering:
        """At one level of refinement; refused where even the hidden blobs are too many."""
        count = int(node_counts(elements, fineness).sum())
        if count > MOST_HIDDEN:
            raise too_many(count)
        return cover(elements, fineness, frame)

    found = refine(covering, COARSEST, accuracy, group)
    offset, about_reference = about_centre_of_diffusion(found.mobility)
    shares = sphere_coupling(found.covering, found.coupling, elements.start[: len(spheres)], radii[spheres], group)
    coupling = np.zeros((len(radii), 6, 6))
    coupling[spheres] = shift(-offset) @ shares
    blobs = len(found.covering.area)
    return assemble(middle + offset, about_reference, coupling, error=found.error, blobs=blobs)


@dataclass(frozen=True, eq=False)
class Refined:
    """What the finest level and the extrapolation to zero spacing give, about the origin of the coverings.

    Attributes:
        mobility: (6, 6) extrapolated.
        error: Change of the mobility from the level before, relative to the diagonal.
        covering: The finest one, n blobs.
        coupling: (6, n, 3) velocity and angular velocity per flow velocity at each blob of it.
    """

    mobility: np.ndarray
    error: float
    covering: Covering
    coupling: np.ndarray


def refine(
    cover_with: Callable[[int], Covering], coarsest: int, accuracy: float, group: Sequence[Symmetry] = ()
) -> Refined:
    """Double the blobs until the mobility changes by no more than the wanted accuracy.

    Args:
        cover_with: Makes a covering from a number that its blobs are proportional to.
        coarsest: The first such number.
        accuracy: Wanted relative error.
        group: Symmetries that the mobility is averaged over.

    Raises:
        InputError: More than `MOST_BLOBS` blobs would be needed.
    """
    fineness, error = coarsest, float("inf")
    mobility = None
    while True:
        try:
            covering = cover_with(fineness)
            if len(covering.area) > MOST_BLOBS:
                raise too_many(len(covering.area))
        except InputError as refusal:
            raise InputError(f"{refusal}; {_within_reach(error)}") from None
        friction = surface_friction(covering)
        raw = inverse(friction.resistance)
        previous, mobility = mobility, _averaged(raw, group)
        if previous is not None:
            error = relative_change(mobility, previous)
            if error <= accuracy:
                best = _extrapolated(mobility, previous)
                return Refined(best, error, covering, np.einsum("ac,bic->abi", raw, friction.force))
        fineness *= 2


def _extrapolated(mobility: np.ndarray, previous: np.ndarray) -> np.ndarray:
    best = mobility + EXTRAPOLATION * (mobility - previous)
    # a change of half the diagonal, which the coarsest accuracy allows, could lead out of the positive definite
    return best if np.linalg.eigvalsh(best * _unit(mobility))[0] > 0.0 else mobility


def _unit(mobility: np.ndarray) -> np.ndarray:
    scale = 1.0 / np.sqrt(np.diag(mobility))
    return scale[:, None] * scale


def too_many(count: int) -> InputError:
    """The refusal of a covering that is too large."""
    return InputError(f"needs {count} surface blobs, more than {MOST_BLOBS}")


def _within_reach(reached: float) -> str:
    least = f"[{reached:.2g}, 0.5] for this body" if np.isfinite(reached) else "fewer spheres and rods"
    return f"allowed: {least}, or 0 for the pair mobilities of its spheres alone"


def _centred(elements: Elements) -> tuple[Elements, np.ndarray]:
    """The elements about the mean of their axes, weighted with their surfaces, and that mean.

    A body far from its prim's origin loses no digits.
    """
    middle = np.average(0.5 * (elements.start + elements.end), axis=0, weights=elements.area)
    return Elements(elements.start - middle, elements.end - middle, elements.radius), middle


def _without_buried_rods(elements: Elements, spheres: int) -> Elements:
    """Leave out rods inside another element; of coincident equal rods the first stays."""
    # [i, j]: ends of i, axis of j
    reach = np.maximum(elements.distance(elements.start), elements.distance(elements.end))
    inside = reach + elements.radius[:, None] <= elements.radius * (1.0 + COINCIDENT)
    kept = ~swallowed(inside) | (np.arange(len(inside)) < spheres)
    return Elements(elements.start[kept], elements.end[kept], elements.radius[kept])


def _averaged(mobility: np.ndarray, group: Sequence[Symmetry]) -> np.ndarray:
    maps = [s.wrench_map for s in group] or [np.eye(6)]
    return symmetric(np.mean([q.T @ mobility @ q for q in maps], axis=0))
