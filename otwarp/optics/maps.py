"""Force map of a trap in a plane through the beam's axis, with the basin of attraction of its equilibrium."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.optics.beam import Beam
from otwarp.optics.curves import INK, save_picture, setup_line
from otwarp.optics.fit import trap_region
from otwarp.optics.mie import Particle
from otwarp.optics.models import Ladder
from otwarp.optics.table import ForceTable, layer_count, major_axis

FLOW_STEP = 0.08
"""Step along a flow line, in wavelengths."""

LONGEST_PATH, NO_RETURN = 6.0, 2.5
"""Length of a flow line, and distance from the equilibrium, at which it is given up, in trap regions: what circles or
sits elsewhere never arrives, and the light carries off what is far away."""

HALVINGS = 10
"""Bisections of every crossing of the basin's boundary: to a thousandth of a grid cell."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ForceMap:
    """Force in the plane of the beam's axis and the major axis of its polarization, at the beam's power.

    Attributes:
        beam, sphere: What was evaluated.
        azimuth: Of the plane, from x [rad]; any plane is the same in a circularly polarized beam.
        across: (columns,) distance from the axis along that azimuth [µm].
        height: (rows,) z from the focus [µm].
        force: (rows, columns, 2) components across and along the axis [pN].
        faint: Force below which the table does not tell the direction [pN].
        equilibrium: z of the stable point on the axis nearest the focus [µm], or None.
        escape: Polylines (n, 2) of (across, z): the escape contour, see `escape_contour`. Empty without equilibrium.
        reach: Distance from the equilibrium to the escape contour [µm] `sideways`, `downstream` and `upstream`; None
            where it lies beyond the map.
    """

    beam: Beam
    sphere: Particle
    azimuth: float
    across: np.ndarray
    height: np.ndarray
    force: np.ndarray
    faint: float
    equilibrium: float | None
    escape: tuple[np.ndarray, ...]
    reach: dict[str, float | None]


def plane_force(table: ForceTable, places: np.ndarray) -> np.ndarray:
    """(n, 2) Q across and along the axis at (across, z) in the plane of the major axis, (n, 2) [µm]."""
    turn = major_axis(table.beam)
    c, s = math.cos(turn), math.sin(turn)
    q = table.force(np.stack([places[:, 0] * c, places[:, 0] * s, places[:, 1]], axis=1))
    return np.stack([q[:, 0] * c + q[:, 1] * s, q[:, 2]], axis=1)


def attracted(table: ForceTable, places: np.ndarray, *, region: float) -> np.ndarray:
    """Whether a sphere released at each place (n, 2) [µm] flows to the equilibrium, dx/dt ∝ F(x), without noise.

    Flow lines are followed at unit speed by the midpoint rule, which keeps their shape. The flow stays in the plane of
    the major axis for circular and for linear polarization, by symmetry; an elliptical beam or a polarized vortex also
    pushes out of it, which is left out. Beyond the table's cut-off there is no force, and no return.

    Args:
        region: Size of the trap [µm], the unit of `LONGEST_PATH` and `NO_RETURN`.

    Raises:
        ValueError: The beam does not hold this sphere.
    """
    if table.properties is None:
        raise ValueError("the table's beam does not hold its sphere, so nothing flows to its equilibrium")
    goals = np.array([[0.0, z] for z in (table.properties.equilibrium, *table.properties.others)])
    step = FLOW_STEP * min(table.beam.wavelength, region)
    arrived = np.full(len(places), -1)
    place, moving = places.astype(float), np.arange(len(places))
    for _ in range(math.ceil(LONGEST_PATH * region / step)):
        gap = np.linalg.norm(place[moving, None, :] - goals, axis=2)
        nearest = np.argmin(gap, axis=1)
        done = gap[np.arange(len(moving)), nearest] < 2.0 * step
        arrived[moving[done]] = nearest[done]
        moving = moving[~done & (gap[:, 0] < NO_RETURN * region)]
        if len(moving) == 0:
            break
        ahead = place[moving] + 0.5 * step * _direction(plane_force(table, place[moving]))
        way = _direction(plane_force(table, ahead))
        place[moving] += step * way
        moving = moving[np.any(way != 0.0, axis=1)]
    return arrived == 0


def _direction(force: np.ndarray) -> np.ndarray:
    """Unit vectors, or 0 where there is no force."""
    length = np.linalg.norm(force, axis=1, keepdims=True)
    return np.divide(force, length, out=np.zeros_like(force), where=length > 0.0)


def escape_contour(
    table: ForceTable, across: np.ndarray, height: np.ndarray, *, region: float
) -> tuple[np.ndarray, ...]:
    """Boundary of the basin of attraction of the equilibrium in the deterministic flow dx/dt ∝ F(x).

    A sphere released inside it, without thermal motion, moves to the equilibrium; one outside is lost or goes to
    another stable point. The basin is a matter of directions alone: its rim may be a place where hardly any force acts,
    and a sphere upstream on the axis belongs to it although nothing holds it there, since the light pushes it into the
    trap. Thermal escape does not need to follow the contour: it happens where the work against the force is least.

    Args:
        table: Force table of a beam that holds its sphere.
        across: (columns,) symmetric grid about the axis [µm].
        height: (rows,) grid in z from the focus [µm].
        region: Size of the trap [µm].

    Returns:
        Polylines (n, 2) of (across, z) [µm]; open where the basin leaves the grid.
    """
    from contourpy import contour_generator

    half = across[across >= 0.0]
    x, z = np.meshgrid(half, height)
    inside = attracted(table, np.stack([x.ravel(), z.ravel()], axis=1), region=region).reshape(x.shape)
    # the plane of the major axis is mirror-symmetric about the beam's axis
    mirrored = inside[:, :0:-1] if half[0] == 0.0 else inside[:, ::-1]
    whole = np.concatenate([mirrored, inside], axis=1)
    lines = []
    # every vertex is the middle of a grid edge with one end in the basin
    for vertices in contour_generator(z=whole.astype(float)).lines(0.5):
        column, row = np.asarray(vertices).T
        ends = [np.stack([f(column).astype(int), f(row).astype(int)], axis=1) for f in (np.floor, np.ceil)]
        first_in = whole[ends[0][:, 1], ends[0][:, 0]][:, None]
        near, far = (np.stack([across[e[:, 0]], height[e[:, 1]]], axis=1) for e in ends)
        near, far = np.where(first_in, near, far), np.where(first_in, far, near)
        lines.append(_bisect(table, near, far, region))
    return tuple(lines)


def _bisect(table: ForceTable, inside: np.ndarray, outside: np.ndarray, region: float) -> np.ndarray:
    """(n, 2) points of the basin's boundary between places inside and outside it."""
    for _ in range(HALVINGS):
        middle = 0.5 * (inside + outside)
        within = attracted(table, middle, region=region)[:, None]
        inside, outside = np.where(within, middle, inside), np.where(within, outside, middle)
    return 0.5 * (inside + outside)


def basin_reach(table: ForceTable, *, region: float, samples: int = 64) -> dict[str, float | None]:
    """Distance from the equilibrium to the boundary of the basin of attraction [µm].

    Args:
        table: Forces of one beam and sphere.
        region: How far to look [µm].
        samples: Places on each way, between which the boundary is bisected.

    Returns:
        Way (`sideways`, `downstream`, `upstream`) → distance, None beyond `region`; empty without an equilibrium.
    """
    if table.properties is None:
        return {}
    centre = np.array([0.0, table.properties.equilibrium])
    ways = {"sideways": (1.0, 0.0), "downstream": (0.0, 1.0), "upstream": (0.0, -1.0)}
    distance = np.linspace(0.0, region, samples)
    found: dict[str, float | None] = {}
    for name, way in ways.items():
        line = centre + distance[:, None] * np.array(way)
        outside = np.flatnonzero(~attracted(table, line, region=region))
        if len(outside) == 0:
            found[name] = None
            continue
        edge = _bisect(table, line[None, outside[0] - 1], line[None, outside[0]], region)
        found[name] = float(np.linalg.norm(edge[0] - centre))
    return found


def force_map(ladder: Ladder, *, samples: int = 161, basin_samples: int = 61) -> ForceMap:
    """Map the table's force over the trap region about the equilibrium, or about the focus where there is none.

    Args:
        ladder: Beam, sphere and the table's options.
        samples: Points of the map along either axis, odd.
        basin_samples: Points along either axis of the coarse grid on which the basin is first looked for, odd.
    """
    table, region = ladder.table, trap_region(ladder.beam, ladder.sphere)
    centre = table.properties.equilibrium if table.properties else None
    line, coarse = np.linspace(-region, region, samples), np.linspace(-region, region, basin_samples)
    across, height = line, line + (centre or 0.0)
    x, z = np.meshgrid(across, height)
    q = plane_force(table, np.stack([x.ravel(), z.ravel()], axis=1)).reshape(*x.shape, 2)
    scale = ladder.beam.force_scale
    return ForceMap(
        beam=ladder.beam,
        sphere=ladder.sphere,
        azimuth=major_axis(ladder.beam),
        across=across,
        height=height,
        force=scale * q,
        faint=scale * table.peak * ladder.tolerance,
        equilibrium=centre,
        escape=() if centre is None else escape_contour(table, coarse, coarse + centre, region=region),
        reach=basin_reach(table, region=region),
    )


def plot_map(found: ForceMap, path: Path) -> None:
    """Draw magnitude as colour, directions as arrows, equilibrium, sphere and escape contour.

    Raises:
        InputError: The file cannot be written.
    """
    from matplotlib.colors import PowerNorm
    from matplotlib.figure import Figure

    m = found
    figure = Figure(figsize=(7.4, 6.6), layout="constrained")
    axes = figure.subplots()
    strength = np.linalg.norm(m.force, axis=2)
    extent = (m.across[0], m.across[-1], m.height[0], m.height[-1])
    image = axes.imshow(
        strength, origin="lower", extent=extent, cmap="cividis", norm=PowerNorm(0.5, 0.0), interpolation="bicubic"
    )
    bar = figure.colorbar(image, ax=axes, shrink=0.9, pad=0.02, label="force (pN)")
    bar.outline.set_visible(False)
    _draw_arrows(axes, m, strength)
    _draw_trap(axes, m)
    axes.set(xlim=extent[:2], ylim=extent[2:], aspect="equal")
    round_beam = layer_count(m.beam) == 1
    plane = "distance from the axis" if round_beam else f"along the major axis, {math.degrees(m.azimuth):.3g}° from x"
    axes.set(xlabel=f"{plane} (µm)", ylabel="z from the focus, with the light (µm)")
    axes.spines[:].set_visible(False)
    figure.suptitle(setup_line(m.beam, m.sphere).replace("    ", "\n"), fontsize=10, color=INK)
    save_picture(figure, path)


def _draw_arrows(axes: Any, m: ForceMap, strength: np.ndarray) -> None:
    """Unit arrows on a thinned grid, paler where the table does not vouch for the direction."""
    every = max(1, len(m.across) // 24)
    start = (len(m.across) // 2) % every
    thin = (slice(start, None, every), slice(start, None, every))
    x, z = np.meshgrid(m.across[start::every], m.height[start::every])
    size = strength[thin].ravel()
    way = _direction(m.force[thin].reshape(-1, 2))
    # white arrows on dark ground, dark ones on bright
    colour = np.where((size > 0.4 * strength.max())[:, None], [0.06, 0.1, 0.17, 0.85], [1.0, 1.0, 1.0, 0.85])
    colour[size <= m.faint, 3] = 0.35
    axes.quiver(
        *(x.ravel(), z.ravel(), way[:, 0], way[:, 1]),
        **{"color": colour, "pivot": "mid", "units": "width"},
        **{"scale": 36.0, "width": 0.0024, "headwidth": 4.5, "headlength": 5.0, "headaxislength": 4.5},
    )


def _draw_trap(axes: Any, m: ForceMap) -> None:
    from matplotlib.patheffects import withStroke

    if m.equilibrium is None:
        box = {"facecolor": "#101a2c", "edgecolor": "none", "alpha": 0.75, "boxstyle": "round"}
        axes.text(
            *(0.97, 0.03, "no equilibrium on the axis"),
            **{"color": "white", "ha": "right", "size": 8.5, "transform": axes.transAxes, "bbox": box},
        )
        return
    dark = [withStroke(linewidth=3.2, foreground="#101a2c")]
    for n, line in enumerate(m.escape):
        label = None if n else "escape contour"
        axes.plot(line[:, 0], line[:, 1], color="#ff9f6b", lw=1.8, label=label, path_effects=dark)
    angle = np.linspace(0.0, 2.0 * math.pi, 181)
    axes.plot(
        *(m.sphere.radius * np.cos(angle), m.equilibrium + m.sphere.radius * np.sin(angle)),
        **{
            "color": "white",
            "lw": 1.4,
            "ls": (0, (5, 2.5)),
            "label": "sphere at the equilibrium",
            "path_effects": dark,
        },
    )
    axes.plot(0.0, m.equilibrium, "o", ms=6.5, mfc="white", mec=INK, mew=1.2, ls="", label="equilibrium", zorder=6)
    axes.legend(loc="lower right", fontsize=8.5, framealpha=0.75, facecolor="#101a2c", edgecolor="none", labelcolor="w")
