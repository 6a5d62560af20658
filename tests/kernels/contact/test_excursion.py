"""Thermal excursions of a gap: their draws, their distribution, the least load."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.contact import overlap_alone as end_alone
from otwarp.kernels.contact.excursion import (
    FARTHEST,
    LAYER,
    RESOLVED,
    SOFT,
    YIELD_APART,
    YIELD_IN,
    excursion_term,
    kept_reach,
    obstacle_name,
    path_tangent,
    swept_reach,
)
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import MediumData, ModelData
from otwarp.simulation.packing.arrays import device_array
from tests.kernels.samples import evaluate, on_device
from tests.reference.contact import overlap_alone

ENERGY, GIVE = 4.1e-3, 0.0095
SPREAD = float(np.sqrt(2.0 * ENERGY * GIVE))
"""s [µm]."""
HARD = 4.8e9
"""K of a polymer bead of 1 µm [pN/µm^{3/2}]: its thermal layer is 2·10⁻⁵ µm."""

ROUNDING = 1e-5
"""Relative, of a chain of some ten float32 operations."""

FEATURES = Features(driver="world", obstacles=("plane",), pairs=True)
_draw = excursion_term(FEATURES)
_none = excursion_term(dataclasses.replace(FEATURES, brownian=False))


@wp.kernel(enable_backward=False)
def probe(
    model: ModelData,
    given: wp.array(dtype=wp.vec4),
    names: wp.array(dtype=wp.vec2i),
    step: wp.int64,
    warm: int,
    out: wp.array(dtype=wp.vec4),
):
    """overlap, opening, K and give in; wander, layer and load of the contact alone out."""
    i = wp.tid()
    c = Contact()
    c.overlap = given[i][0]
    c.hardness = given[i][2]
    c.give = given[i][3]
    if warm != 0:
        c = _draw(model, 0, c, given[i][1], names[i][0], names[i][1], 0, step)
    else:
        c = _none(model, 0, c, given[i][1], names[i][0], names[i][1], 0, step)
    load = 0.0
    reach = kept_reach(c, given[i][1])
    if reach > 0.0:
        load = c.hardness * wp.pow(end_alone(c.hardness, c.give, reach), 1.5)
    out[i] = wp.vec4(c.wander, c.layer, load, float(obstacle_name(names[i][0])))


def draws(device, given, names, *, step: int = 7, energy: float = ENERGY, warm: bool = True) -> np.ndarray:
    """(n, 4) outputs of `probe` for (n, 4) or (4,) contacts and (n, 2) names."""
    model = ModelData()
    model.seed = 11
    model.medium = MediumData()
    model.medium.thermal_energy = device_array([energy], wp.float32, device)
    names = np.asarray(names, dtype=np.int32)
    given = np.broadcast_to(np.asarray(given, dtype=np.float32), (len(names), 4)).copy()
    (got,) = evaluate(
        probe,
        len(names),
        [model, *on_device(device, (given, wp.vec4), (names, wp.vec2i)), wp.int64(step), int(warm)],
        [wp.vec4],
        device,
    )
    return got


def thermal_layer(hardness: float, give: float, overlap: float) -> float:
    """Depth [µm] of the thermal layer of a contact."""
    depth = (2.5 * ENERGY / hardness) ** 0.4
    kappa = 1.5 * hardness * np.sqrt(depth) * give
    return depth * (LAYER - (YIELD_IN if overlap > 0.0 else YIELD_APART) / (1.0 + kappa / RESOLVED))


def numbered(n: int) -> np.ndarray:
    return np.stack([np.arange(n), np.arange(n) + 3], axis=1)


def test_both_partners_draw_the_same(device):
    """Whichever is named first; pairs, obstacles and steps differ."""
    names = np.array([[3, 8], [8, 3], [3, 9], [2, 8], [3, -1], [3, -2], [-1, 3]])
    touching = (0.0, 0.0, HARD, GIVE)
    wander = draws(device, touching, names)[:, 0]
    assert wander[0] == wander[1]
    assert wander[4] == wander[6]
    assert len(set(wander)) == 5
    assert np.all(draws(device, touching, names, step=8)[:, 0] != wander)
    assert np.all(draws(device, touching, np.arange(7)[:, None] * [1, 0])[:, 3] == -1 - np.arange(7))


@pytest.mark.parametrize(("start", "end"), [(0.5, 0.5), (0.0, 1.0), (1.0, 0.2), (1.5, 1.5), (-0.3, 0.8)])
def test_a_hard_wall_pushes_by_what_the_bridge_misses(start, end, device):
    """P(push > y) = P(least gap < −y) = exp(−2 (g₀ + y)(g₁ + y)/s²), the reflection principle. Standard errors of these
    shares of 40 000 draws are below 0.0025; 5σ."""
    n = 40_000
    got = draws(device, (-start * SPREAD, (end - start) * SPREAD, HARD, GIVE), numbered(n))
    push = got[:, 2] * GIVE / SPREAD
    # Hertz's overlap under the load, which the bare wall of the closed form has not
    push += (got[:, 2] / HARD) ** (2 / 3) / SPREAD + LAYER * (2.5 * ENERGY / HARD) ** 0.4 / SPREAD
    for y in (0.05, 0.2, 0.5, 1.0):
        low, high = max(start + y, 0.0), max(end + y, 0.0)
        share = np.exp(-2.0 * low * high)
        chance = np.sqrt(share * (1.0 - share) / n)
        assert abs(np.mean(push > y) - share) < 5.0 * chance + 1e-12


def test_the_load_is_that_of_the_twin(device):
    """From the given draw: backward Euler of a gap that ends lower by g₁ − m less the layer; K over ten decades."""
    rng, n = np.random.default_rng(2), 3000
    hardness = 10.0 ** rng.uniform(2, 10, n)
    overlap, opening = rng.normal(size=(2, n)) * SPREAD * 0.7
    given = np.stack([overlap, opening, hardness, np.full(n, GIVE)], axis=1).astype(np.float32)
    got = draws(device, given, numbered(n))
    pushed = 0
    for (d, o, k, give), (wander, layer, load, _) in zip(given.astype(float), got, strict=True):
        if wander == 0.0:
            continue
        assert layer == pytest.approx(thermal_layer(k, give, d), rel=ROUNDING)
        lower = max(0.5 * (o + np.sqrt(o * o + wander)) - layer, 0.0)
        reach = d - o + lower
        if reach > 1e-4 * SPREAD:
            expected = k * overlap_alone(k, give, reach) ** 1.5
            assert load == pytest.approx(expected, rel=2e-3)
            pushed += 1
        elif reach < -1e-4 * SPREAD:
            assert load == 0.0
    assert pushed > 500


def test_what_cannot_touch_draws_nothing(device):
    """Far gaps, soft contacts, no temperature, no noise in the scene."""
    names, s = numbered(50), SPREAD
    gap, far = 0.9 * float(FARTHEST) * s, 1.1 * float(FARTHEST) * s
    assert np.all(draws(device, (-gap, 0.0, HARD, GIVE), names)[:, 0] > 0.0)
    assert not draws(device, (-far, 0.0, HARD, GIVE), names)[:, :3].any()
    assert np.all(draws(device, (-far, -far, HARD, GIVE), names)[:, 0] > 0.0)
    soft = 2.5 * ENERGY * (LAYER / (1.1 * SOFT * s)) ** 2.5
    assert not draws(device, (0.01, 0.0, soft, GIVE), names)[:, :2].any()
    assert not draws(device, (0.0, 0.0, HARD, GIVE), names, energy=0.0)[:, :3].any()
    assert not draws(device, (0.0, 0.0, HARD, GIVE), names, warm=False)[:, :3].any()


@wp.kernel(enable_backward=False)
def probe_line(given: wp.array2d(dtype=float), line: wp.array(dtype=wp.vec2), swept: wp.array(dtype=float)):
    """Overlap, apart, K, give, wander, layer and floor in, then opening, load and row sum; line and swept reach out."""
    i = wp.tid()
    c = Contact()
    c.radius = 1.0
    c.overlap = given[i, 0]
    c.hardness = given[i, 2]
    c.give = given[i, 3]
    c.wander = given[i, 4]
    c.layer = given[i, 5]
    c.floor = given[i, 6]
    d = path_tangent(c, given[i, 1])
    line[i] = wp.vec2(d.force, d.stiffness)
    swept[i] = swept_reach(c, given[i, 7], given[i, 8], given[i, 9])


def kept_load(overlap: float, apart: float, k: float, give: float, wander: float, layer: float) -> float:
    """Load above the floor [pN] of a contact whose gap all else opens by `apart` [µm], in float64."""
    end = 0.5 * (apart + np.sqrt(apart * apart + wander))
    reach = overlap - apart + max(end - layer, 0.0)
    return k * overlap_alone(k, give, reach) ** 1.5 if reach > 0.0 else 0.0


def test_lines_are_tangents_and_sweeps_rest_at_the_law(device):
    """λ(s) = F − k·s touches the law where the gap ends, s the opening with the load, and has its slope there; and a
    sweep from the law's own load stays there, whatever the row sum. K over six decades, with adhesion."""
    rng, n = np.random.default_rng(4), 400
    hardness, row_sum = 10.0 ** rng.uniform(4, 10, n), rng.uniform(1.0, 4.0, n)
    wander = -2.0 * SPREAD**2 * np.log(rng.random(n))
    layer = LAYER * (2.5 * ENERGY / hardness) ** 0.4
    overlap, apart = rng.normal(size=(2, n)) * SPREAD * 0.5
    floor = -rng.uniform(0.0, 2.0, n)
    loads = np.array([kept_load(*v) for v in zip(overlap, apart, hardness, [GIVE] * n, wander, layer, strict=True)])
    opening = apart + GIVE * loads
    given = np.stack(
        [overlap, apart, hardness, np.full(n, GIVE), wander, layer, floor, opening, floor + loads, row_sum], axis=1
    )
    line, swept = evaluate(
        probe_line, n, [wp.array(given, dtype=wp.float32, device=device)], [wp.vec2, float], device
    )  # fmt: skip
    seen = 0
    for i in range(n):
        end = 0.5 * (apart[i] + np.sqrt(apart[i] ** 2 + wander[i]))
        if end < 1.01 * layer[i] or GIVE * loads[i] < 0.01 * SPREAD:
            continue
        seen += 1
        force, slope = line[i]
        assert (force - slope * opening[i]) - floor[i] == pytest.approx(loads[i], rel=1e-3)
        step = 1e-4 * SPREAD
        less, more = (
            kept_load(overlap[i], apart[i] + h, hardness[i], GIVE, wander[i], layer[i]) for h in (-step, step)
        )
        fall = (less - more) / (2.0 * step)
        assert slope == pytest.approx(fall / (1.0 - GIVE * fall), rel=0.01)
        expected = GIVE * loads[i] + (loads[i] / hardness[i]) ** (2 / 3)
        assert swept[i] == pytest.approx(expected, rel=1e-3, abs=1e-4 * SPREAD)
    assert seen > 100
